"""Triangulation of quads and polygons: choice of the diagonal, and messages where no triangulation is valid."""

import numpy as np
import pytest

from clothsim.files.meshes.mesh_file import read_mesh


def write(path, text):
    path.write_text(text)
    return path


def obj_of(points, face):
    return "".join(f"v {x} {y} {z}\n" for x, y, z in points) + "f " + " ".join(map(str, face)) + "\n"


def area(mesh):
    corners = mesh.positions[mesh.triangles]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return 0.5 * cross[:, 2]


@pytest.mark.parametrize("turn", range(4))
def test_quads_are_cut_along_the_shorter_diagonal(tmp_path, turn):
    kite = [[0, 0, 0], [1, -2, 0], [2, 0, 0], [1, 2, 0]]
    mesh = read_mesh(write(tmp_path / "kite.obj", obj_of(kite, np.roll([1, 2, 3, 4], turn))))
    assert all({0, 2} <= set(triangle) for triangle in mesh.triangles.tolist())
    np.testing.assert_allclose(area(mesh), 2)


@pytest.mark.parametrize("turn", range(4))
def test_an_arrow_is_cut_inside(tmp_path, turn):
    arrow = [[0, 0, 0], [2, -1, 0], [0.5, 0, 0], [2, 1, 0]]  # the shorter way 1-3 lies outside
    mesh = read_mesh(write(tmp_path / "arrow.obj", obj_of(arrow, np.roll([1, 2, 3, 4], turn))))
    assert (area(mesh) > 0).all() or (area(mesh) < 0).all()
    assert all({0, 2} <= set(triangle) for triangle in mesh.triangles.tolist())


def test_a_star_shaped_polygon_is_cut_without_overlap(tmp_path):
    house = [[0, 0, 0], [2, 0, 0], [2, 1, 0], [1, 0.4, 0], [0, 1, 0]]
    mesh = read_mesh(write(tmp_path / "house.obj", obj_of(house, [1, 2, 3, 4, 5])))
    assert (area(mesh) > 0).all()
    assert area(mesh).sum() == pytest.approx(2 - 0.6)
    assert mesh.messages == ("1 faces of 5 corners cut into triangles",)


def test_a_polygon_that_no_fan_can_cut_is_reported(tmp_path):
    comb = [[0, 0, 0], [6, 0, 0], [6, 3, 0], [5, 3, 0], [5, 1, 0], [3.5, 1, 0], [3.5, 3, 0], [2.5, 3, 0], [2.5, 1, 0]]
    comb += [[1, 1, 0], [1, 3, 0], [0, 3, 0]]
    mesh = read_mesh(write(tmp_path / "comb.obj", obj_of(comb, range(1, 13))))
    assert "1 of them fold or bend inward, first face 0" in mesh.messages
