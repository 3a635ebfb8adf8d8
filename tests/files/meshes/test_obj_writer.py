"""Copy of an OBJ with other positions: what stays, what is left out."""

import numpy as np
import pytest

from clothsim.base.errors import InputError
from clothsim.files.meshes.mesh_file import read_mesh, read_polygons
from clothsim.files.meshes.obj_writer import moved_obj

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
