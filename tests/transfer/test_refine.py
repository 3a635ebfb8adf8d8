"""DRAPE refinement: direction, distance, and unchanged cases."""

import numpy as np
import pytest

from clothsim.mesh.generators.table import GENERATORS
from transfer.errors import TransferError
from transfer.refine import DAMPING, ActiveRows, clearances, normal_equations, refine, sample_weights
from transfer.refine import _deviation as deviation
from transfer.signed_distance import body_surface
from transfer.triangle_surface import convex_curvature, edges_of


def rotation(vector):
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(vector).as_matrix()


BALL = GENERATORS["sphere"](radius=0.5, subdivisions=4)
ROUND, SHIRT_TRIANGLES = GENERATORS["sphere"](radius=1.0, subdivisions=3)
SHIRT = ROUND @ rotation([0.3, 0.7, -0.4])  # so that no vertex lies below one of the ball, where closest points tie
BOX = GENERATORS["slab"](size=(2.0, 2.0, 2.0), cells=(2, 2, 2))
FAR = np.array([[5.0, 0, 0], [6, 0, 0], [5, 1, 0]])


def test_a_vertex_inside_goes_out_along_the_normal_towards_eps():
    """An isolated vertex has no mean: each pass leaves lam_d / (1 + lam_d) of the way to eps outside."""
    depth, eps = 0.1, 0.002  # so that it is still inside after three passes
    garment = np.concatenate([FAR, [[0.2, 0.1, 1 - depth]]])
    left = depth + eps
    for passes in (1, 2, 3):
        refined = refine(garment, [[0, 1, 2]], *BOX, eps=eps, passes=passes)
        left *= DAMPING[passes - 1] / (1 + DAMPING[passes - 1])
        np.testing.assert_allclose(refined.positions[3], [0.2, 0.1, 1 + eps - left], atol=1e-9)
        np.testing.assert_array_equal(refined.positions[:3], FAR)


@pytest.mark.parametrize("radius", [0.49, 0.45, 0.35])
def test_a_shirt_in_a_ball_ends_outside(radius):
    refined = refine(radius * SHIRT, SHIRT_TRIANGLES, *BALL)
    assert refined.inside[0] == len(SHIRT)
    assert (refined.inside[-1], refined.depth[-1]) == (0, 0)
    assert refined.depth[0] == pytest.approx(0.5 - radius, abs=3e-3)
    assert refined.passes < 12
    middles = refined.positions[SHIRT_TRIANGLES].mean(axis=1)
    assert (np.linalg.norm(middles, axis=1) > 0.498).all()
    assert (np.linalg.norm(refined.positions, axis=1) < 0.53).all()


def test_without_samples_the_middles_stay_inside():
    refined = refine(0.45 * SHIRT, SHIRT_TRIANGLES, *BALL, eps=1e-4, samples=False)
    assert refined.inside[-1] == 0
    assert body_surface(*BALL).penetration(refined.positions[SHIRT_TRIANGLES].mean(axis=1)).count > 0


def test_eps_keeps_the_middles_of_triangles_outside():
    """The closed form: the middle of a triangle of edge h on a sphere of curvature c is h^2 c / 6 below it."""
    np.testing.assert_allclose(convex_curvature(*BALL), 2.0, rtol=4e-2)
    edges = edges_of(SHIRT_TRIANGLES)
    aims = clearances(0.5 * SHIRT, edges, body_surface(*BALL))
    wanted = aims.of(np.eye(len(SHIRT)), np.zeros(len(SHIRT), np.int64))
    below = 0.5 - np.linalg.norm((0.5 * SHIRT)[SHIRT_TRIANGLES].mean(axis=1), axis=1)
    assert (wanted.min() > below).all()
    assert wanted.max() < 3 * below.max() + aims.floor


def test_nothing_inside_is_unchanged_to_the_bit():
    garment = 0.51 * SHIRT
    refined = refine(garment, SHIRT_TRIANGLES, *BALL)
    np.testing.assert_array_equal(refined.positions, garment)
    assert (refined.passes, refined.inside, refined.depth) == (0, (0,), (0.0,))


def test_a_component_outside_stays_to_the_bit():
    both = np.concatenate([0.45 * SHIRT, 0.45 * SHIRT + [2, 0, 0]])
    triangles = np.concatenate([SHIRT_TRIANGLES, SHIRT_TRIANGLES + len(SHIRT)])
    refined = refine(both, triangles, *BALL)
    assert refined.inside[-1] == 0
    np.testing.assert_array_equal(refined.positions[len(SHIRT) :], both[len(SHIRT) :])
    alone = refine(0.45 * SHIRT, SHIRT_TRIANGLES, *BALL).positions
    np.testing.assert_allclose(refined.positions[: len(SHIRT)], alone, atol=1e-7)


def test_it_does_not_depend_on_the_unit():
    one = refine(0.45 * SHIRT, SHIRT_TRIANGLES, *BALL).positions
    hundred = refine(45 * SHIRT, SHIRT_TRIANGLES, 100 * BALL[0], BALL[1]).positions
    np.testing.assert_allclose(hundred, 100 * one, atol=1e-5)


def test_an_open_body_wound_inward_pushes_outward():
    kept = BALL[1][BALL[0][BALL[1]][:, :, 2].mean(axis=1) < 0.45][:, ::-1]
    low = SHIRT_TRIANGLES[SHIRT[SHIRT_TRIANGLES][:, :, 2].max(axis=1) < 0.3]
    refined = refine(0.45 * SHIRT, low, BALL[0], kept)
    touched = np.unique(low)
    assert (np.linalg.norm(refined.positions[touched], axis=1) > 0.498).all()


def test_the_equations_are_symmetric_positive_definite():
    sheet, triangles = GENERATORS["rectangle"](cells=(3, 3))
    edges = edges_of(triangles)
    weights = sample_weights(triangles, edges, len(sheet) + 1)
    rows = np.arange(0, weights.shape[0], 2)
    normals = np.random.default_rng(0).normal(size=(len(rows), 3))
    targets = ActiveRows(rows, normals / np.linalg.norm(normals, axis=1, keepdims=True), np.ones(len(rows)))
    for k, lam_d in enumerate((*DAMPING, DAMPING[-1])):
        matrix, _ = normal_equations(weights, targets, deviation(edges, len(sheet) + 1), k)
        dense = matrix.toarray()
        np.testing.assert_allclose(dense, dense.T, atol=1e-14)
        assert np.linalg.eigvalsh(dense).min() >= lam_d - 1e-12


def test_a_thin_limb_is_left_on_the_side_the_garment_faces():
    """A sleeve moved sideways by more than the limb's radius is nearer to the wrong side."""
    limb = GENERATORS["capsule"](radius=0.05, height=0.8, segments=24)
    sleeve, triangles = GENERATORS["tube"](radius=0.055, height=0.4, cells=(24, 16))
    moved = sleeve + np.array([0.06, 0, 0])
    closest = refine(moved, triangles, *limb)
    along = refine(moved, triangles, *limb, along_normals=True)
    behind = sleeve[:, 0] < -0.05
    assert along.inside[-1] == 0
    assert (along.positions[behind, 0] < 0).all()
    assert (closest.positions[behind, 0] > 0).any()


def test_bad_input_is_named():
    with pytest.raises(TransferError, match=r"eps .*-0\.01"):
        refine(SHIRT, SHIRT_TRIANGLES, *BALL, eps=-0.01)
    with pytest.raises(TransferError, match=r"passes .*0"):
        refine(SHIRT, SHIRT_TRIANGLES, *BALL, passes=0)
    with pytest.raises(TransferError, match="garment triangles"):
        refine(SHIRT, np.zeros((0, 3), int), *BALL)
