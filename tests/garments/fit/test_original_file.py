"""`fitted.obj` as an edit of the file that came: whole, part, welded, of a .mhclo, of a scene."""

import numpy as np
import pytest
from fitting_cases import capsule_figure, tube_garment
from real_data import DATA, needs_data

from clothsim.files.meshes.mesh_file import read_polygons
from clothsim.files.meshes.readers.obj import obj_text
from clothsim.garments.inputs import NO_ORIGINAL, fitted_text, read_garment, worn_in_scene

QUADS = """o tube
v 0 0 0
v 1 0 0
v 2 0 0
v 0 1 0
v 1 1 0
v 2 1 0
vt 0 0
vt 1 0
vt 1 1
vt 0 1
g front
usemtl cotton
f 1/1 2/2 5/3 4/4
g back
f 2/1 3/2 6/3 5/4
"""
PANELS = QUADS.replace("f 2/1 3/2 6/3 5/4", "v 1 0 0\nv 1 1 0\nf 7/1 3/2 6/3 8/4")
"""The second quad is a panel of its own, beside the first."""


def read(tmp_path, text, **options):
    (tmp_path / "garment.obj").write_text(text)
    return read_garment(tmp_path / "garment.obj", None, options.pop("scale", 1.0), **options)


def written(tmp_path, garment, positions):
    (tmp_path / "fitted.obj").write_text(fitted_text(garment.original, positions))
    return read_polygons(tmp_path / "fitted.obj")


def same_faces(one, other):
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in ("corners", "starts", "texture"))


def test_quads_groups_and_texture_stay(tmp_path):
    garment = read(tmp_path, QUADS, scale=0.1)
    assert len(garment.triangles) == 4
    fitted = written(tmp_path, garment, garment.positions + 0.5)
    assert same_faces(fitted, read_polygons(tmp_path / "garment.obj"))
    assert fitted.groups.keys() == {"tube", "front", "back"}
    assert np.array_equal(fitted.positions, garment.positions + 0.5)  # in metres
    assert garment.original.note == ""
    assert "usemtl cotton" in (tmp_path / "fitted.obj").read_text().splitlines()


def test_welded_panels_come_back_as_panels(tmp_path):
    garment = read(tmp_path, PANELS, weld=0.1)
    assert len(garment.positions) == 6
    fitted = written(tmp_path, garment, garment.positions + np.array([0.0, 0.0, 2.0]))
    assert same_faces(fitted, read_polygons(tmp_path / "garment.obj"))
    assert np.array_equal(fitted.positions[[6, 7]], fitted.positions[[1, 4]])
    assert (fitted.positions[:, 2] == 2.0).all()
    assert garment.original.note.startswith("2 vertices coincide")


def test_a_part_leaves_the_rest_of_the_file_out(tmp_path):
    later = QUADS.replace("f 1/1 2/2 5/3 4/4", "f 3/1 4/2 7/3 6/4").replace(
        "f 2/1 3/2 6/3 5/4", "f -5/1 -4/2 -1/3 -2/4"
    )
    garment = read(tmp_path, "v 9 9 9\nv 8 8 8\n" + later, part=(2, 8))
    fitted = written(tmp_path, garment, garment.positions)
    (tmp_path / "alone.obj").write_text(QUADS)
    alone = read_polygons(tmp_path / "alone.obj")
    assert same_faces(fitted, alone)
    assert np.array_equal(fitted.positions, alone.positions)
    assert garment.original.note.startswith("2 vertices")


def test_a_welded_part(tmp_path):
    body = capsule_figure(segments=8)
    first = len(body.positions)
    later = PANELS.replace("f 1/1 2/2 5/3 4/4", "f -6/1 -5/2 -2/3 -3/4")
    later = later.replace("f 7/1 3/2 6/3 8/4", "f -2/1 -6/2 -3/3 -1/4")
    garment = read(tmp_path, obj_text(body.positions, body.triangles) + later, part=(first, first + 8), weld=0.1)
    assert len(garment.positions) == 6
    fitted = written(tmp_path, garment, garment.positions)
    assert len(fitted.positions) == 8
    assert len(fitted.starts) == 3
    assert garment.original.note.count(";") == 1


def test_other_files_have_no_original(tmp_path):
    import trimesh

    tube = tube_garment(0.11)
    trimesh.Trimesh(tube.positions, tube.triangles, process=False).export(tmp_path / "tube.ply")
    garment = read_garment(tmp_path / "tube.ply", None, 1.0)
    assert garment.original is NO_ORIGINAL
    assert fitted_text(garment.original, garment.positions) is None


def test_a_row_beyond_the_garment_is_no_copy(tmp_path):
    garment = read(tmp_path, QUADS)
    assert fitted_text(garment.original, garment.positions[:3]) is None


@pytest.mark.parametrize(("keys", "kept"), [("", True), ("weld = 1e-6\n", False), ("vertices = [0, 6]\n", False)])
def test_the_file_of_a_scene_is_kept_where_it_is_worn_whole(tmp_path, keys, kept):
    (tmp_path / "garment.obj").write_text(QUADS)
    body = capsule_figure(segments=8)
    (tmp_path / "body.obj").write_text(obj_text(body.positions, body.triangles))
    scene = tmp_path / "scene.toml"
    scene.write_text(f'[cloth]\nmesh = "garment.obj"\n{keys}[body]\nmesh = "body.obj"\n[effects.inertia]\n')
    garment, _ = worn_in_scene(scene)
    assert bool(garment.original.name) == kept


@needs_data
def test_a_suit_keeps_its_quads(tmp_path):
    file = DATA / "garments" / "female_sportsuit01.mhclo"
    garment = read_garment(file, DATA / "bodies" / "makehuman_hm08_base.obj", 0.1)
    fitted = written(tmp_path, garment, garment.positions)
    before = read_polygons(file.with_suffix(".obj"))
    assert same_faces(fitted, before)
    assert set(np.diff(fitted.starts)) == {4}
    assert np.array_equal(fitted.positions, garment.positions)
