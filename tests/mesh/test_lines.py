"""Polylines snapped to the edges of a mesh.

Stitches between two lines by arc length, and hinges over a closed seam.
"""

import numpy as np
import pytest
from meshes import grid, irregular_grid

from clothsim.base.errors import InputError
from clothsim.mesh.lines import hinges_across, line_of, path_along, stitches
from clothsim.mesh.topology import border_edges, unique_edges


def test_a_line_along_a_row_is_that_row():
    positions, triangles = grid(5, 4)
    path = path_along("line", positions, unique_edges(triangles), np.array([[0.4, 1.0, 0.0], [0.4, 0.0, 0.0]]))
    assert np.array_equal(positions[path], [[0.4, y, 0.0] for y in (1.0, 0.75, 0.5, 0.25, 0.0)])


def test_it_goes_through_every_point_in_order_and_along_edges():
    positions, triangles = irregular_grid(1, 8, 8)
    edges = unique_edges(triangles)
    stops = [3, 70, 44]
    path = path_along("line", positions, edges, positions[stops])
    assert path[0] == 3
    assert path[-1] == 44
    assert 70 in path
    assert {tuple(sorted(pair)) for pair in zip(path[:-1], path[1:], strict=True)} <= set(map(tuple, edges))


def test_an_oblique_line_is_never_a_cell_away():
    positions, triangles = grid(12, 12)
    path = path_along("line", positions, unique_edges(triangles), np.array([[0.0, 0.0, 0.0], [1.0, 0.4, 0.0]]))
    x, y, _ = positions[path].T
    assert np.abs(y - 0.4 * x).max() < 1 / 12


def test_along_the_border_it_goes_round_the_corner():
    positions, triangles = grid(3, 3)
    edges = border_edges(triangles)[0]
    path = path_along("line", positions, edges, np.array([[0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [1.0, 0.0, 0.0]]))
    assert len(path) == 7


def test_two_pieces_are_not_joined():
    positions, triangles = grid(2, 2)
    both = np.concatenate([positions, positions + np.array([2.0, 0.0, 0.0])])
    edges = unique_edges(np.concatenate([triangles, triangles + len(positions)]))
    with pytest.raises(InputError, match="path"):
        path_along("line", both, edges, np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 0.0]]))


def along(*parameters, first=0):
    """A line along x with vertices at these places."""
    return line_of(first + np.arange(len(parameters)), np.array([[x, 0.0, 0.0] for x in parameters]))


def test_places_are_fractions_of_the_length():
    corner = line_of(np.array([7, 3, 5]), np.array([[0.0, 0, 0], [3, 0, 0], [3, 1, 0]]))
    assert corner.vertices.tolist() == [7, 3, 5]
    assert corner.parameters.tolist() == [0, 0.75, 1]


@pytest.mark.parametrize("turned", [False, True])
def test_the_finer_line_meets_points_of_the_coarser(turned):
    coarse, fine = along(0, 2), along(0, 1, 4, first=2)
    rows, weights = stitches(fine, coarse) if turned else stitches(coarse, fine)
    assert rows.tolist() == [[2, 0, 1], [3, 0, 1], [4, 0, 1]]
    assert np.allclose(weights, [[1, -1, 0], [1, -0.75, -0.25], [1, 0, -1]])


def test_points_of_equal_fractions_coincide_whatever_the_lengths():
    rng = np.random.default_rng(0)
    parameters = np.sort(rng.random(9))
    first, second = along(*parameters), along(*(5 + 3 * np.sort(rng.random(6))), first=9)
    rows, weights = stitches(first, second)
    share = np.concatenate([first.parameters, second.parameters])
    assert np.abs((weights * share[rows]).sum(axis=1)).max() < 1e-15


def test_hinges_are_there_for_vertices_that_meet_one_to_one():
    positions, triangles = grid(2, 3)
    left, right = (np.flatnonzero(positions[:, 0] == x) for x in (0.0, 1.0))
    first, second = line_of(left, positions[left]), line_of(right, positions[right])
    hinges, beside = hinges_across(first, second, triangles)
    assert len(hinges) == 3
    assert np.isin(hinges[:, :2], left).all()
    assert (positions[hinges[:, 2], 0] <= 0.5).all()
    assert (positions[hinges[:, 3], 0] >= 0.5).all()
    for hinge, (here, there) in zip(hinges, beside, strict=True):
        assert set(hinge[:3]) == set(triangles[here])
        assert hinge[3] in triangles[there]
    uneven = line_of(right[[0, 1, 3]], positions[right[[0, 1, 3]]])
    assert not len(hinges_across(first, uneven, triangles)[0])
