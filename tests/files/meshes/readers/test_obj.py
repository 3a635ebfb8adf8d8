"""OBJ read by columns: the same polygons as line by line, or none.

Copy of an OBJ with other positions: what stays, what is left out.
"""

from pathlib import Path

import numpy as np
import pytest
from real_data import DATA, needs_data

from clothsim.base.errors import InputError
from clothsim.files.meshes.mesh_file import read_mesh, read_polygons
from clothsim.files.meshes.readers import obj
from clothsim.files.meshes.readers.obj import moved_obj, polygons_by_columns

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0.5\n"
ALIKE = {
    "plain": TRIANGLE + "f 1 2 3\nf 3 2 1\n",
    "quads": TRIANGLE + "v 1 1 0\nf 1 2 4 3\nf 1 2 3\n",
    "texture": TRIANGLE + "f 1/1 2/2 3/1\n",
    "normals": TRIANGLE + "vn 0 0 1\nf 1//1 2//1 3//1\n",
    "both": TRIANGLE + "vn 0 0 1\nf 1/1/1 2/2/1 3/2/1\n",
    "groups": "o all\n" + TRIANGLE + "g a b\nf 1 2 3\ng\nf 2 3 1\ng b\nf 3 1 2\nf 3 2 1\no other\nf 1 3 2\n",
    "exponents": "v 1e-3 -2.5E2 +7\nv .1 1. 0\nv 0.1 0.30000000000000004 4.9e-324\n# end\n\nf 1 2 3\n",
}
NOT_ALIKE = {
    "negative": TRIANGLE + "f -3 -2 -1\n",
    "mixed": TRIANGLE + "f 1/1 2 3/1/1\n",
    "colours": "v 0 0 0 1 1 1\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    "comment": TRIANGLE + "f 1 2 3 # last\n",
    "unknown": TRIANGLE + "sew 1 2\nf 1 2 3\n",
    "continued": TRIANGLE + "f 1 2 \\\n3\n",
    "nan": "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    "beyond": TRIANGLE + "f 1 2 4\n",
    "zero": TRIANGLE + "f 0 1 2\n",
    "huge": TRIANGLE + f"f 1 2 {10**30}\n",
    "underscore": "v 1_0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    "two corners": TRIANGLE + "f 1 2\n",
    "texture beyond": TRIANGLE + "f 1/1 2/2 3/3\n",
    "fraction": TRIANGLE + "f 1 2 3.5\n",
    "no faces": TRIANGLE,
    "many groups": TRIANGLE + "g " + " ".join("abcdefghi") + "\nf 1 2 3\n",
}


def by_lines(text, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(obj, "polygons_by_columns", lambda _: None)
        return obj.read_obj(Path("some.obj"), text)


def same(a, b):
    arrays = all(
        np.array_equal(getattr(a, name), getattr(b, name)) and getattr(a, name).dtype == getattr(b, name).dtype
        for name in ("positions", "corners", "starts", "texture")
    )
    groups = a.groups.keys() == b.groups.keys() and all(np.array_equal(a.groups[k], b.groups[k]) for k in a.groups)
    return arrays and groups and a.messages == b.messages


@pytest.mark.parametrize("name", ALIKE)
def test_what_is_alike_is_read_to_the_same_bits(name, monkeypatch):
    monkeypatch.setattr(obj, "FEWEST", 1)
    found = polygons_by_columns(ALIKE[name])
    assert found is not None
    assert same(found, by_lines(ALIKE[name], monkeypatch))


@pytest.mark.parametrize("name", NOT_ALIKE)
def test_what_is_not_is_left_to_the_other_reader(name, monkeypatch):
    monkeypatch.setattr(obj, "FEWEST", 1)
    assert polygons_by_columns(NOT_ALIKE[name]) is None


def test_random_numbers_keep_their_bits(monkeypatch):
    points = np.random.default_rng(1).normal(size=(800, 3)) * 10.0 ** np.arange(-4, 4).repeat(100)[:, None]
    rows = [f"v {x!r} {y!r} {z!r}" for x, y, z in points.tolist()]
    text = "\n".join([*rows, *(f"f {i} {i + 1} {i + 2}" for i in range(1, 700))])
    found = polygons_by_columns(text)
    assert np.array_equal(found.positions, points)
    assert same(found, by_lines(text, monkeypatch))


@needs_data
@pytest.mark.parametrize("name", ["bodies/makehuman_hm08_base.obj", "garments/female_casualsuit01.obj"])
def test_real_files_are_read_to_the_same_bits(name, monkeypatch):
    text = (DATA / name).read_text()
    found = polygons_by_columns(text)
    assert found is not None
    assert same(found, by_lines(text, monkeypatch))


OBJ = """# a shirt
mtllib shirt.mtl
o shirt
v 0 0 0 0.5 0.25 1 # with a colour
v 1 0 0
v 1 1 0
v 0 1 0
v 5 0 0
v 6 0 0
v 6 1 0
vt 0 0
vt 1 0
vt 1 1
vt 0 1
vn 0 0 1
g front left
usemtl cotton
s 1
f 1/1/1 2/2/1 3/3/1 4/4/1
g back
usemtl denim
f -3//1 \\
  -2//1 -1//1
"""


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "shirt.obj"
    path.write_text(OBJ)
    return path


def moved(file, positions, rows):
    copy = file.with_name("copy.obj")
    copy.write_text(moved_obj(file.read_text(), positions, rows))
    return copy


def test_only_positions_change_and_normals_go(file):
    positions = np.random.default_rng(0).normal(size=(7, 3))
    copy = moved(file, positions, np.arange(7))
    before, after = read_polygons(file), read_polygons(copy)
    assert np.array_equal(after.positions, positions)
    assert np.array_equal(after.corners, before.corners)
    assert after.starts.tolist() == before.starts.tolist() == [0, 4, 7]
    assert {name: faces.tolist() for name, faces in after.groups.items()} == {
        name: faces.tolist() for name, faces in before.groups.items()
    }
    lines = copy.read_text().splitlines()
    for kept in ("# a shirt", "mtllib shirt.mtl", "o shirt", "vt 1 1", "g front left", "usemtl denim", "s 1"):
        assert kept in lines
    assert "f 1/1 2/2 3/3 4/4" in lines
    assert not [line for line in lines if line.startswith("vn")]
    assert lines[3].endswith(" 0.5 0.25 1")


def test_texture_coordinates_stay_at_their_corners(tmp_path):
    text = OBJ.replace("f -3//1 \\\n  -2//1 -1//1\n", "f -3/1 -2/2 -1/3\n")
    (tmp_path / "a.obj").write_text(text)
    copy = moved(tmp_path / "a.obj", np.zeros((7, 3)), np.arange(7))
    assert np.array_equal(read_polygons(copy).texture, read_polygons(tmp_path / "a.obj").texture)


def test_vertices_without_a_row_are_left_out_with_their_faces(file):
    rows = np.array([-1, -1, -1, -1, 0, 1, 2])
    copy = moved(file, np.eye(3), rows)
    mesh = read_mesh(copy)
    assert np.array_equal(mesh.positions, np.eye(3))
    assert mesh.triangles.tolist() == [[0, 1, 2]]
    first = moved(file, np.eye(4)[:, :3], np.arange(4))  # the file has more vertices than rows
    assert read_polygons(first).corners.tolist() == [0, 1, 2, 3]


def test_welded_vertices_share_a_row(file):
    copy = moved(file, np.eye(3), np.array([0, 1, 2, 0, 1, 0, 2]))
    assert np.array_equal(read_mesh(copy).positions, np.eye(3)[[0, 1, 2, 0, 1, 0, 2]])


def test_a_file_with_fewer_vertices_is_refused(file):
    with pytest.raises(InputError, match="7 vertices"):
        moved_obj(file.read_text(), np.zeros((8, 3)), np.arange(8))
