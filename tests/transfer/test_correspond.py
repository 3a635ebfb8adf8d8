"""Correspondence of meshes of different topology: markers matched, surfaces registered, bad markers named.

Similarities found again from points and from boxes.

Closest compatible surface points against brute force, and points without one.
"""

import numpy as np
import pytest
from capsule_bodies import person
from real_data import DATA, needs_data

from clothsim.mesh.generators.table import GENERATORS
from transfer.correspond import Similarity, by_boxes, by_points, correspond, facing_surface, span_a_plane
from transfer.deform import deformation_transfer
from transfer.errors import TransferError
from transfer.gradients import centroids
from transfer.triangle_surface import triangle_normals

FOLDER = DATA / "bodies"

BALL = GENERATORS["sphere"](radius=1.0, subdivisions=2)
FINE = GENERATORS["sphere"](radius=1.0, subdivisions=3)
HALF_AXES, CENTRE = np.array([1.3, 1.0, 0.8]), np.array([2.0, 0, 0])
EGG = FINE[0] * HALF_AXES + CENTRE, FINE[1]
AXES = np.vstack([np.eye(3), -np.eye(3)])


def nearest(points, wanted):
    return np.linalg.norm(points[None] - wanted[:, None], axis=2).argmin(axis=1)


MARKERS = np.column_stack([nearest(BALL[0], AXES), nearest(EGG[0], AXES * HALF_AXES + CENTRE)])


def off_the_surface(points, mesh):
    surface = facing_surface(*mesh)
    squared, _, _ = surface.boxes.squared_distance(surface.positions, surface.triangles, np.ascontiguousarray(points))
    return np.sqrt(squared.ravel())


def flipped(laid, triangles, mesh):
    """The fraction of triangles that face against the nearest of `mesh`."""
    surface = facing_surface(*mesh)
    _, near, _ = surface.boxes.squared_distance(surface.positions, surface.triangles, centroids(laid, triangles))
    return (np.einsum("ta,ta->t", triangle_normals(laid, triangles), surface.normals[near.ravel()]) < 0).mean()


def test_markers_are_met_and_the_surfaces_lie_over_one_another():
    found = correspond(*BALL, *EGG, markers=MARKERS)
    assert not found.derived
    assert np.abs(found.positions[found.markers[:, 0]] - EGG[0][found.markers[:, 1]]).max() < 1e-12
    assert off_the_surface(found.positions, EGG).max() < 0.01
    assert off_the_surface(EGG[0], (found.positions, BALL[1])).max() < 0.05  # BALL's edges are 0.3 long
    assert flipped(found.positions, BALL[1], EGG) == 0


def test_every_triangle_of_both_has_a_pair_near_it():
    found = correspond(*BALL, *EGG, markers=MARKERS)
    assert (np.unique(found.pairs[:, 0]) == np.arange(len(BALL[1]))).all()
    assert (np.unique(found.pairs[:, 1]) == np.arange(len(EGG[1]))).all()
    assert len(np.unique(found.pairs, axis=0)) == len(found.pairs)
    apart = centroids(found.positions, BALL[1])[found.pairs[:, 0]] - centroids(*EGG)[found.pairs[:, 1]]
    assert np.linalg.norm(apart, axis=1).max() < 0.35


def test_a_mesh_corresponds_to_itself():
    found = correspond(*BALL, *BALL, markers=np.column_stack([MARKERS[:, 0]] * 2))
    assert np.abs(found.positions - BALL[0]).max() < 1e-6
    np.testing.assert_array_equal(found.pairs, np.column_stack([np.arange(len(BALL[1]))] * 2))


def test_units_places_and_turns_change_nothing():
    reference = correspond(*BALL, *EGG, markers=MARKERS)
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    moved = correspond(1000 * BALL[0] @ turn.T + 5, BALL[1], 0.01 * EGG[0] - 3, EGG[1], markers=MARKERS)
    # round-off decides between closest points that are as near: BALL is symmetric
    assert np.abs(moved.positions - (0.01 * reference.positions - 3)).max() < 0.01 * 2e-5
    np.testing.assert_array_equal(moved.pairs, reference.pairs)


def test_pairs_carry_a_pose_to_the_other_topology():
    found = correspond(*BALL, *EGG, markers=MARKERS)
    transfer = deformation_transfer(*EGG, found.pairs)
    turn = np.array([[0, -1.0, 0], [1, 0, 0], [0, 0, 1]])
    posed = transfer.pose(*BALL, 2 * BALL[0] @ turn.T)
    assert np.abs(posed - 2 * EGG[0] @ turn.T).max() < 1e-9
    stretched = transfer.pose(*BALL, BALL[0] * [1, 1, 2.0])
    height = np.ptp(stretched[:, 2]) / np.ptp(EGG[0][:, 2])
    assert abs(height - 2.0) < 0.2


def test_people_without_markers_get_derived_ones():
    slim, stout = person(0.045), person(0.036, leg_spread=0.3, arm_drop=0.45, girth=1.25)
    output = []
    found = correspond(*slim, *stout, progress=output.append)
    assert found.derived
    assert len(found.markers) == 8
    assert output[-1].endswith(f"{len(output)} of {len(output)}")
    assert off_the_surface(found.positions, stout).max() < 1e-3
    there = off_the_surface(stout[0], (found.positions, slim[1]))
    assert there.mean() < 4e-3
    assert np.percentile(there, 95) < 0.012
    assert flipped(found.positions, slim[1], stout) < 2e-3


def test_pieces_without_a_marker_ride_along():
    eye = GENERATORS["sphere"](radius=0.1, subdivisions=1)
    source = np.vstack([BALL[0], eye[0] + [0, 0, 0.8]]), np.vstack([BALL[1], eye[1] + len(BALL[0])])
    found = correspond(*source, *EGG, markers=MARKERS)
    middle = found.positions[len(BALL[0]) :].mean(axis=0)
    assert np.linalg.norm(middle - [2.0, 0, 0.8 * 0.8]) < 0.1


def test_open_surfaces_correspond():
    bowl, cup = ((x, t[x[t].mean(axis=1)[:, 2] < 0.3]) for x, t in (BALL, EGG))
    markers = MARKERS[[0, 1, 3, 4, 5]]
    found = correspond(*bowl, *cup, markers=markers)
    assert np.abs(found.positions[found.markers[:, 0]] - cup[0][found.markers[:, 1]]).max() < 1e-12
    used = np.unique(bowl[1])
    assert off_the_surface(found.positions[used], cup).max() < 0.05
    assert np.isfinite(found.positions).all()


@pytest.mark.parametrize(
    ("markers", "output"),
    [
        ([[0, 1], [0, 2]], r"markers \[\[0, 1\], \[0, 2\]\] name vertex 0 .*source"),
        ([[0, 1], [2, 1]], r"vertex 1\b.*target"),
        ([[0, 10_000]], r"vertex 10000\b.*target"),
        ([[-1, 0]], r"vertex -1\b.*source"),
        (np.zeros((0, 2), int), "markers"),
        ([[0.5, 1.0]], "float64"),
        ([[0, 1, 2]], "markers"),
    ],
)
def test_bad_markers_are_named(markers, output):
    with pytest.raises(TransferError, match=output):
        correspond(*BALL, *EGG, markers=markers)


def test_the_same_marker_twice_is_one():
    twice = correspond(*BALL, *EGG, markers=np.vstack([MARKERS, MARKERS[:2]]))
    assert len(twice.markers) == len(MARKERS)


def test_a_target_turned_inside_out_is_refused():
    with pytest.raises(TransferError, match="orientation"):
        correspond(*BALL, EGG[0], EGG[1][:, ::-1], markers=MARKERS)


@needs_data
def test_real_bodies_of_other_topology_derive_landmarks_that_mean_the_same():
    from clothsim.files.meshes.mesh_file import read_mesh
    from transfer.body_parts import derive_markers

    meshes = [read_mesh(FOLDER / name) for name in ("f_smpl_average_A40.obj", "mean_female.obj")]
    source, target = ((mesh.positions, mesh.triangles) for mesh in meshes)
    markers = derive_markers(source, target)
    apart = np.linalg.norm(source[0][markers[:, 0]] - target[0][markers[:, 1]], axis=1)
    assert len(markers) == 8
    assert apart.max() < 0.2  # the hands' poses differ
    assert np.median(apart) < 0.05


RNG = np.random.default_rng(2)
POINTS = RNG.normal(size=(9, 3))
TRIANGLES = np.arange(9).reshape(3, 3)
TURN = np.linalg.qr(RNG.normal(size=(3, 3)))[0]
TURN *= np.sign(np.linalg.det(TURN))


def test_points_give_the_similarity_back_also_where_they_lie_in_a_plane():
    made = Similarity(2.3, TURN, np.array([1.0, 2.0, 3.0]))
    for points in (POINTS, POINTS * [1, 1, 0], POINTS[:3]):
        found = by_points(points, made.apply(points))
        np.testing.assert_allclose(found.apply(POINTS), made.apply(POINTS), atol=1e-12)


def test_a_mirrored_target_is_never_met_by_a_mirror():
    found = by_points(POINTS, POINTS * [-1, 1, 1])
    assert np.linalg.det(found.rotation) > 0


def test_boxes_are_laid_over_one_another():
    found = by_boxes((POINTS, TRIANGLES), (3 * POINTS + [0, 5, 0], TRIANGLES))
    np.testing.assert_allclose(found.apply(POINTS), 3 * POINTS + [0, 5, 0], atol=1e-12)


def test_points_on_a_line_fix_no_rotation():
    assert span_a_plane(POINTS[:3])
    assert not span_a_plane(POINTS[:2])
    assert not span_a_plane(np.outer(np.arange(4.0), [1, 2, 3]))
    assert not span_a_plane(np.ones((4, 3)))


SMALL, SMALL_TRIANGLES = GENERATORS["sphere"](radius=0.5, subdivisions=3)


def test_the_closest_point_is_taken_where_it_faces_the_same_way():
    directions = SMALL[::7] / 0.5
    triangles, points = facing_surface(SMALL, SMALL_TRIANGLES).closest_valid(1.4 * directions, directions)
    np.testing.assert_allclose(points, SMALL[::7], atol=1e-12)
    assert (np.einsum("ka,ka->k", triangle_normals(SMALL, SMALL_TRIANGLES)[triangles], directions) > 0).all()


def test_a_sheet_that_faces_away_is_passed_over():
    """Two sheets, 0.1 apart, of opposite winding: from near the wrong one the other is found."""
    flat, faces = GENERATORS["rectangle"](size=(1.0, 1.0), cells=(8, 8))
    positions = np.vstack([flat, flat + np.array([0, 0, 0.1])])
    both = np.vstack([faces, faces[:, ::-1] + len(flat)])
    up = triangle_normals(flat, faces)[0]
    queries = centroids(flat, faces) + np.array([0, 0, 0.09])
    triangles, points = facing_surface(positions, both).closest_valid(queries, np.tile(up, (len(queries), 1)))
    assert (triangles < len(faces)).all()
    np.testing.assert_allclose(np.linalg.norm(points - queries, axis=1), 0.09, atol=1e-12)


def test_a_point_with_no_facing_surface_near_has_none():
    flat, faces = GENERATORS["rectangle"](size=(1.0, 1.0), cells=(4, 4))
    down = -triangle_normals(flat, faces)[:1]
    triangles, _ = facing_surface(flat, faces).closest_valid(np.array([[0.1, 0.1, 0.3]]), down)
    assert triangles.tolist() == [-1]
