"""Polylines snapped to the edges of a mesh."""

import numpy as np
import pytest
from meshes import grid, irregular_grid

from clothsim.base.errors import InputError
from clothsim.mesh.edge_paths import path_along
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
