"""Welding of borders and of coincident vertices."""

import numpy as np
import pytest
from meshes import grid

from clothsim.base.errors import InputError
from clothsim.mesh import weld as weld_module
from clothsim.mesh.checks import examine
from clothsim.mesh.topology import border_edges, components, interior_edges
from clothsim.mesh.weld import flaps, mean_of_parts, merge_coincident, weld


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


def test_a_distance_that_takes_in_everything_is_refused(monkeypatch):
    monkeypatch.setattr(weld_module, "MOST_PAIRS", 20)
    points, faces = grid(80, 80)
    with pytest.raises(InputError, match=r"weld.* 20 "):
        weld(points, faces, 0.2 * float(np.ptp(points, axis=0).max()))


@pytest.mark.parametrize("distance", [0.6, 5.0, 1e300])
def test_a_distance_wider_than_a_quarter_of_the_mesh_is_refused(distance):
    points, faces = two_panels(gap=2e-3)
    with pytest.raises(InputError, match=r"weld.* quarter"):
        weld(points, faces, distance)


@pytest.mark.parametrize("distance", [-1.0, np.nan, "wide"])
def test_a_bad_distance_is_named(distance):
    with pytest.raises(InputError, match="weld"):
        weld(*grid(2, 2), distance)


def test_vertices_at_one_place_become_one_in_order_of_appearance():
    points = np.array([[1, 0, 0], [0, 0, 0], [1, 0, 0], [2, 0, 0], [-0.0, 0, 0]])
    merged, number = merge_coincident(points)
    np.testing.assert_array_equal(merged, [[1, 0, 0], [0, 0, 0], [2, 0, 0]])
    np.testing.assert_array_equal(number, [0, 1, 0, 2, 1])


def test_means_are_taken_of_the_same_parts():
    points = np.arange(12.0).reshape(4, 3)
    np.testing.assert_array_equal(mean_of_parts(points, np.array([0, 1, 0, 2])), [[3, 4, 5], [3, 4, 5], [9, 10, 11]])


def three_layers():
    """Three panels, each of two triangles, that have one edge at x = 0 in common."""
    turns = np.radians([0.0, 120.0, 240.0])
    panels = [[[r * np.cos(t), r * np.sin(t), z] for r in (0, 1) for z in (0, 1)] for t in turns]
    faces = np.array([[0, 2, 3], [0, 3, 1]])
    return np.concatenate(panels), np.concatenate([faces + 4 * k for k in range(3)])


def test_a_seam_of_three_layers_is_reported_for_a_sewn_cloth_and_refused_of_another():
    points, triangles, _ = weld(*three_layers(), 1e-3)
    assert len(points) == 8
    assert [fault.kind for fault in examine("x", points, triangles).errors] == ["fin"]
    report = examine("x", points, triangles, "sewn cloth")
    reported = next(fault for fault in report.warnings if fault.kind == "fin")
    assert report.errors == ()
    assert "0-1" in reported.sentence
    np.testing.assert_array_equal(reported.indices, [[0, 1]])


def test_a_seam_of_three_layers_is_no_border_and_no_hinge():
    _, triangles, _ = weld(*three_layers(), 1e-3)
    hinges, _ = interior_edges(triangles)
    assert [0, 1] not in np.sort(hinges[:, :2], axis=1).tolist()
    assert len(hinges) == 3  # the diagonals of the panels
    borders = np.sort(border_edges(triangles)[0], axis=1)
    assert len(borders) == 9
    assert [0, 1] not in borders.tolist()


def test_flaps_are_triangles_sewn_face_to_face():
    triangles = np.array([[0, 1, 2], [2, 1, 3], [1, 0, 2], [4, 5, 6], [5, 6, 4], [1, 2, 4]])
    assert flaps(triangles).tolist() == [0, 2]  # 3 and 4 repeat each other: the doctor's business
    assert flaps(triangles[1:2]).tolist() == []
