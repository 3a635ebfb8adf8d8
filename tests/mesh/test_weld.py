"""Sewing borders and merging vertices at one place."""

import numpy as np
import pytest
from meshes import grid

from clothsim.errors import InputError
from clothsim.mesh.check import examine
from clothsim.mesh.topology import border_edges, components
from clothsim.mesh.weld import merge_coincident, weld


def two_panels(gap):
    points, faces = grid(4, 4)
    return np.vstack([points, points + np.array([1.0 + gap, 0.0, 0.0])]), np.vstack([faces, faces + len(points)])


def test_close_borders_are_sewn_at_their_mean_and_nothing_else_moves():
    points, faces = two_panels(gap=2e-3)
    welded, triangles, number = weld(points, faces, 3e-3)
    assert len(welded) == len(points) - 5
    assert components(triangles, len(welded)).max() == 0
    assert len(border_edges(triangles)[0]) == 24
    np.testing.assert_array_equal(triangles, number[faces])
    seam = number[20:25]
    np.testing.assert_array_equal(seam, number[25:30])
    np.testing.assert_allclose(welded[seam, 0], 1.001, rtol=1e-15)
    others = np.setdiff1d(np.arange(len(points)), np.arange(20, 30))
    np.testing.assert_array_equal(welded[number[others]], points[others])
    assert examine("sewn", welded, triangles).findings == ()


@pytest.mark.parametrize("distance", [0.0, 1e-3])
def test_nothing_within_reach_changes_nothing(distance):
    points, faces = two_panels(gap=2e-3)
    welded, triangles, number = weld(points, faces, distance)
    np.testing.assert_array_equal(welded, points)
    np.testing.assert_array_equal(triangles, faces)
    np.testing.assert_array_equal(number, np.arange(len(points)))


def test_inner_vertices_are_never_merged():
    points, faces = grid(4, 4)
    points[12] = points[7] + (1e-4, 0.0, 0.0)  # two inner vertices almost at one place
    assert len(weld(points, faces, 1e-3)[0]) == len(points)


@pytest.mark.parametrize("distance", [0.26, 0.3])
def test_a_distance_beyond_the_edges_still_sews_the_seam_and_collapses_nothing(distance):
    points, faces = two_panels(gap=2e-3)
    welded, triangles, number = weld(points, faces, distance)
    np.testing.assert_array_equal(number[20:25], number[25:30])
    corners = np.sort(triangles, axis=1)
    assert (np.diff(corners, axis=1) > 0).all()
    assert len(welded) == len(points) - 5


@pytest.mark.parametrize("gap", [0.0, 1e-4])
def test_four_panels_that_meet_in_a_corner_share_one_vertex(gap):
    points, faces = grid(2, 2)
    shifts = [np.array([i * (1 + gap), j * (1 + gap), 0.0]) for i in (0, 1) for j in (0, 1)]
    panels = np.vstack([points + shift for shift in shifts])
    welded, triangles, _ = weld(panels, np.vstack([faces + 9 * k for k in range(4)]), 2e-4)
    assert len(welded) == 25
    assert examine("sewn", welded, triangles).findings == ()


def test_a_distance_that_takes_in_everything_is_refused():
    points, faces = grid(80, 80)
    with pytest.raises(InputError, match="more than 200 neighbours"):
        weld(points, faces, 10.0)


@pytest.mark.parametrize("distance", [-1.0, np.nan, "wide"])
def test_a_bad_distance_is_named(distance):
    with pytest.raises(InputError, match="weld must be"):
        weld(*grid(2, 2), distance)


def test_vertices_at_one_place_become_one_in_order_of_appearance():
    points = np.array([[1, 0, 0], [0, 0, 0], [1, 0, 0], [2, 0, 0], [-0.0, 0, 0]])
    merged, number = merge_coincident(points)
    np.testing.assert_array_equal(merged, [[1, 0, 0], [0, 0, 0], [2, 0, 0]])
    np.testing.assert_array_equal(number, [0, 1, 0, 2, 1])
