"""Shapes: winding and welding."""

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
from meshes import grid
from real_data import DATA, needs_data

from clothsim import InputError, Scene
from clothsim.files.meshes.readers.obj import write_obj
from clothsim.geometry.intersection.intersecting_pairs import intersecting_pairs
from clothsim.mesh.cloth import triangle_planes
from clothsim.mesh.generators.shapes import rectangle
from clothsim.mesh.topology import components
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.assembly.shapes import Shape, wound_alike
from clothsim.scene.scene import make_scene

NONE = np.zeros((0, 3, 2))


def mixed():
    points, triangles = rectangle(cells=(4, 4))
    turned = np.arange(len(triangles)) % 3 == 0
    return points, triangles, np.where(turned[:, None], triangles[:, [0, 2, 1]], triangles)


def test_a_scene_rewinds_its_cloth_and_notes_it(tmp_path):
    points, triangles, given = mixed()
    write_obj(tmp_path / "sheet.obj", points, given)
    built = build(Scene(cloth={"mesh": "sheet.obj"}, effects={"inertia": {}}, directory=tmp_path))
    assert np.array_equal(built.world.triangles, triangles)
    assert any("11 of 32 triangles" in note for note in built.notes)


def test_a_consistent_shape_is_the_same_object():
    points, triangles, _ = mixed()
    shape = Shape(points, triangles, NONE, ())
    assert wound_alike(shape) is shape


def test_the_material_plane_keeps_its_lengths_and_orientation():
    points, triangles, given = mixed()
    planes = triangle_planes(points, given)
    shape = wound_alike(Shape(points, given, planes, ()))
    assert np.array_equal(shape.triangles, triangles)

    def doubled_areas(corners):
        edges = corners[:, 1:] - corners[:, :1]
        return edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]

    assert np.allclose(doubled_areas(shape.texture), doubled_areas(planes))
    before = np.linalg.norm(points[triangles] - points[np.roll(triangles, 1, axis=1)], axis=2)
    after = np.linalg.norm(shape.texture - np.roll(shape.texture, 1, axis=1), axis=2)
    assert np.allclose(before, after)


ROOT = Path(__file__).parents[3]

PANEL, FACES = grid(3, 3)
ASIDE = np.array([2.5, 0.0, 0.0])
"""Where the second panel lies in the file, apart from the first; in the drape they touch."""


def write_panels(path, positions, triangles, texture=None):
    """An OBJ of panels; `texture (n, 2)` one pair for each vertex."""
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in positions.tolist()]
    if texture is not None:
        lines += [f"vt {u!r} {v!r}" for u, v in texture.tolist()]
    corner = "{0}" if texture is None else "{0}/{0}"
    lines += ["f " + " ".join(corner.format(v) for v in face) for face in (triangles + 1).tolist()]
    path.write_text("\n".join(lines))


def two_panels(folder, gap=1e-3, extra=False):
    """stage.obj: two panels apart, their pattern in vt; drape.obj: they meet but for `gap` in a fold, `extra`: between
    two triangles of something else."""
    stage, faces = np.concatenate([PANEL, PANEL + ASIDE]), np.concatenate([FACES, FACES + 16])
    upright = PANEL[:, [2, 1, 0]] + [1 + gap, 0.0, 0.0]
    drape = np.concatenate([PANEL, upright])
    write_panels(folder / "stage.obj", stage, faces, stage[:, :2])
    if extra:
        corners = np.concatenate([40 + np.eye(3), drape, 50 + np.eye(3)])
        write_panels(folder / "drape.obj", corners, np.concatenate([[[0, 1, 2]], faces + 3, [[35, 36, 37]]]))
    else:
        write_panels(folder / "drape.obj", drape, faces)
    return stage, drape


def sewn(folder, seed=None, **keys):
    table = {"mesh": "stage.obj", "rest": "vt", "weld": 2e-3, **keys}
    seed = {"from": "file", "file": "drape.obj", **(seed or {})}
    built = build(Scene(cloth=table, effects={"membrane": {}}, seed=seed, directory=folder))
    return built.world.cloths[0], built.notes


def test_panels_are_sewn_where_they_touch_in_the_seed(tmp_path):
    stage, drape = two_panels(tmp_path, gap=1e-3)
    cloth, notes = sewn(tmp_path)
    assert len(cloth.positions) == 28
    assert any(re.search(r"cloth.*\b4\b", note) for note in notes)
    assert components(cloth.triangles, 28).max() == 0
    seam = np.isclose(cloth.positions[:, 0], 1.0005)
    assert seam.sum() == 4
    assert np.array_equal(cloth.positions[:12], drape[:12])
    assert np.array_equal(cloth.material_coordinates, stage[np.concatenate([FACES, FACES + 16])][:, :, :2])
    assert cloth.flat


def test_without_a_seed_panels_that_lie_apart_stay_apart(tmp_path):
    two_panels(tmp_path)
    table = {"mesh": "stage.obj", "rest": "vt", "weld": 2e-3}
    world = build(Scene(cloth=table, effects={"membrane": {}}, directory=tmp_path)).world
    assert world.n_cloth == 32


def test_with_the_file_as_rest_shape_panels_are_sewn_there_and_the_seed_with_them(tmp_path):
    flat = np.concatenate([PANEL, PANEL + np.array([1.001, 0.0, 0.0])])
    write_panels(tmp_path / "stage.obj", flat, np.concatenate([FACES, FACES + 16]))
    two_panels_apart = np.concatenate([PANEL, PANEL + np.array([1.2, 0.0, 0.4])])
    write_panels(tmp_path / "drape.obj", two_panels_apart, np.concatenate([FACES, FACES + 16]))
    cloth, _ = sewn(tmp_path, rest="file")
    assert len(cloth.positions) == 28
    seam = np.flatnonzero(np.isclose(cloth.rest_positions[:, 0], 1.0005))
    np.testing.assert_allclose(cloth.positions[seam][:, [0, 2]], [[1.1, 0.2]] * 4, atol=1e-15)


def test_a_seed_is_a_part_of_its_file_and_can_be_moved(tmp_path):
    _, drape = two_panels(tmp_path, extra=True)
    cloth, _ = sewn(tmp_path, {"vertices": [3, 35], "position": [0.0, 0.75, 0.0]})
    assert np.array_equal(cloth.positions[:12], drape[:12] + np.array([0.0, 0.75, 0.0]))
    with pytest.raises(InputError, match=r"drape\.obj.* 38 .* 32\b"):
        sewn(tmp_path)
    with pytest.raises(InputError, match=r"drape\.obj.* 3 .*\[0, 3\].* 32\b"):
        sewn(tmp_path, {"vertices": [0, 3]})
    with pytest.raises(InputError, match=r"seed\.position"):
        sewn(tmp_path, {"vertices": [3, 35], "position": [0.75]})


def test_triangles_sewn_on_all_sides_are_left_out(tmp_path):
    """Two panels, one over the other, sewn along their whole border: four corner triangles lie on one another."""
    lid = PANEL + np.array([0, 0, 1e-3])
    inner = (PANEL[:, :2] > 0.1).all(axis=1) & (PANEL[:, :2] < 0.9).all(axis=1)
    lid[inner, 2] = 0.3
    write_panels(tmp_path / "bag.obj", np.concatenate([PANEL, lid]), np.concatenate([FACES, FACES[:, ::-1] + 16]))
    built = build(Scene(cloth={"mesh": "bag.obj", "weld": 2e-3}, effects={"membrane": {}}, directory=tmp_path))
    assert len(built.world.triangles) == 36 - 4
    assert built.world.n_cloth == 32 - 12 - 2
    corner = next(t for t, face in enumerate(FACES) if 12 in face)
    assert f"cloth: 4 triangles sewn to one another on all sides were left out, the first {corner}" in built.notes


def test_a_fin_that_the_file_has_is_refused_even_where_seams_are_sewn(tmp_path):
    fin = np.concatenate([PANEL, [[0.5, 0.5, 1.0]]])
    edge = FACES[4][:2]
    write_panels(tmp_path / "fin.obj", fin, np.concatenate([FACES, [[*edge, 16]]]))
    for weld in (0.0, 1e-3):
        with pytest.raises(InputError):
            build(Scene(cloth={"mesh": "fin.obj", "weld": weld}, effects={"membrane": {}}, directory=tmp_path))


def test_three_panels_on_one_edge_are_sewn_and_reported(tmp_path):
    turns = [(1, 0), (-0.5, 0.9), (-0.5, -0.9)]
    panels = [PANEL[:, [0]] * [c, 0.0, s] + PANEL[:, [1]] * [0.0, 1.0, 0.0] for c, s in turns]
    write_panels(tmp_path / "fan.obj", np.concatenate(panels), np.concatenate([FACES + 16 * k for k in range(3)]))
    built = build(Scene(cloth={"mesh": "fan.obj", "weld": 1e-3}, effects={"membrane": {}}, directory=tmp_path))
    assert built.world.n_cloth == 48 - 8
    assert any(re.search(r"0-1.*1-2.*2-3", note) for note in built.notes)
    assert len(built.world.hinges.vertices) == 3 * 21  # those of each panel, none across the seam


@needs_data
def test_the_dress_starts_sewn_and_free_of_intersections():
    tables = tomllib.loads((ROOT / "scenes" / "dress.toml").read_text())
    built = build(make_scene(tables | {"effects": {"membrane": {}}}, ROOT / "scenes"))
    world, x = built.world, built.world.start()
    assert (world.n_cloth, len(world.triangles)) == (14855, 29432)
    assert components(world.triangles, world.n_cloth).max() == 0
    assert world.rest_areas.sum() == pytest.approx(0.689051, rel=1e-5)
    assert not len(intersecting_pairs(x, world.triangles, limit=1))
    assert not len(intersecting_pairs(x, world.triangles, world.body_triangles, limit=1))
    drape = np.loadtxt(DATA / "dress_on_body" / "dress_knife_drape.obj", usecols=(1, 2, 3), skiprows=1, max_rows=15656)
    drape += np.array([0, 0.75, 0])
    dress = x[: world.n_cloth]
    np.testing.assert_allclose(dress.min(axis=0), drape.min(axis=0), atol=2e-3)
    np.testing.assert_allclose(dress.max(axis=0), drape.max(axis=0), atol=2e-3)
    assert any(re.search(r"\b30\b", note) for note in built.notes)
