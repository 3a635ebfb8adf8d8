"""Resampling: identical material points on nested meshes, against closed forms."""

import numpy as np
import pytest

from clothsim.mesh.generators.shapes import disk, rectangle
from clothsim.study.evaluation import at_points_of, material_of, nearest_weights, point_areas

UP = np.array([0.0, 0.0, 1.0])


def sheet(cells, diagonals="alternating"):
    rest, triangles = rectangle((1.0, 0.5), cells, diagonals)
    return material_of([rest], [triangles])


@pytest.mark.parametrize("cells", [(4, 2), (16, 8), (5, 3)])
@pytest.mark.parametrize("diagonals", ["alternating", "delaunay"])
def test_a_linear_motion_is_exact_on_any_mesh(cells, diagonals):
    base, run = sheet((8, 4)), sheet(cells, diagonals)
    motion = np.array([[0.9, 0.1, -0.3], [0.2, 1.1, 0.4], [0, 0, 1]])
    found = at_points_of(base, run, run.rest[0] @ motion + [1, 2, 3])
    assert found == pytest.approx(base.rest[0] @ motion + [1, 2, 3], abs=1e-13)


def test_a_finer_nested_mesh_gives_its_own_vertices():
    base, run = sheet((8, 4)), sheet((32, 16))
    bent = np.column_stack([run.rest[0][:, :2], np.sin(7 * run.rest[0][:, 0])])
    assert at_points_of(base, run, bent)[:, 2] == pytest.approx(np.sin(7 * base.rest[0][:, 0]), abs=1e-13)


def test_a_parabola_on_a_coarser_mesh_is_off_by_h2_over_8():
    base, run = sheet((8, 4)), sheet((4, 2))
    bent = np.column_stack([run.rest[0][:, :2], run.rest[0][:, 0] ** 2])
    off = at_points_of(base, run, bent)[:, 2] - base.rest[0][:, 0] ** 2
    h = 1 / 4
    assert off.max() == pytest.approx(h**2 / 4)  # f'' = 2, so h^2/8 f''
    assert off.min() == pytest.approx(0, abs=1e-14)


def test_points_of_a_finer_circle_lie_outside_a_coarser_one_and_still_move_linearly():
    fine, coarse = disk(0.5, 8), disk(0.5, 4)
    _, weights = nearest_weights(fine[0], *coarse)
    assert weights.min() < -1e-3
    found = at_points_of(material_of([fine[0]], [fine[1]]), material_of([coarse[0]], [coarse[1]]), 2 * coarse[0])
    assert found == pytest.approx(2 * fine[0], abs=1e-13)


def test_each_cloth_is_compared_with_itself():
    rest, triangles = rectangle((1.0, 1.0), (2, 2))
    finer, more = rectangle((1.0, 1.0), (4, 4))
    base, run = material_of([rest, rest], [triangles] * 2), material_of([finer, finer], [more] * 2)
    moved = np.concatenate([finer, finer + UP])
    found = at_points_of(base, run, moved)
    assert found == pytest.approx(np.concatenate([rest, rest + UP]), abs=1e-14)


def test_areas_add_up():
    assert point_areas(sheet((4, 2))).sum() == pytest.approx(0.5)
