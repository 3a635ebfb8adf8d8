"""Signed distance to bodies: closed forms on a box and a sphere, and defective bodies."""

import numpy as np
import pytest

from clothsim.mesh.generators.table import GENERATORS
from transfer.errors import TransferError
from transfer.signed_distance import body_surface

BOX, BOX_TRIANGLES = GENERATORS["slab"](size=(2.0, 2.0, 2.0), cells=(4, 4, 4))
BALL, BALL_TRIANGLES = GENERATORS["sphere"](radius=0.5, subdivisions=3)
POINTS = np.random.default_rng(1).uniform(-2, 2, (400, 3))


def box_distance(points):
    """Signed distance to the box [-1, 1]^3."""
    beyond = np.abs(points) - 1
    return np.linalg.norm(np.maximum(beyond, 0), axis=1) + np.minimum(beyond.max(axis=1), 0)


def test_distance_to_a_box_is_the_closed_form():
    closest = body_surface(BOX, BOX_TRIANGLES).closest(POINTS)
    np.testing.assert_allclose(closest.signed_distance, box_distance(POINTS), atol=1e-12)
    assert closest.inside.any()


def test_the_normal_is_outward_and_the_gradient_of_the_distance():
    closest = body_surface(BOX, BOX_TRIANGLES).closest(POINTS)
    np.testing.assert_allclose(closest.points + closest.signed_distance[:, None] * closest.normals, POINTS, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(closest.normals, axis=1), 1, atol=1e-12)
    corners = BOX[BOX_TRIANGLES[closest.triangles]]
    assert (closest.points >= corners.min(axis=1) - 1e-12).all()
    assert (closest.points <= corners.max(axis=1) + 1e-12).all()


def test_on_a_sphere_the_sign_is_that_of_radius_minus_r():
    directions = BALL / 0.5
    body = body_surface(BALL, BALL_TRIANGLES)
    outside = body.closest(0.7 * directions)
    np.testing.assert_allclose(outside.signed_distance, 0.2, atol=1e-12)
    np.testing.assert_allclose(outside.normals, directions, atol=1e-9)
    inside = body.closest(0.3 * directions)
    assert (inside.signed_distance < -0.18).all()
    assert (inside.signed_distance > -0.2 - 1e-12).all()
    assert ((inside.normals * directions).sum(axis=1) > 0.9).all()


def test_a_point_on_the_surface_has_the_vertices_normal_and_is_not_inside():
    closest = body_surface(BALL, BALL_TRIANGLES).closest(BALL)
    np.testing.assert_allclose(closest.signed_distance, 0, atol=1e-9)
    np.testing.assert_allclose(closest.normals, BALL / 0.5, atol=5e-3)


@pytest.mark.parametrize("turned", [slice(None), slice(0, None, 3)], ids=["all", "every third"])
def test_winding_does_not_matter(turned):
    wrong = BALL_TRIANGLES.copy()
    wrong[turned] = wrong[turned][:, ::-1]
    right, other = (body_surface(BALL, triangles).closest(POINTS) for triangles in (BALL_TRIANGLES, wrong))
    np.testing.assert_allclose(other.signed_distance, right.signed_distance, atol=1e-12)


def test_two_overlapping_pieces_are_their_union():
    """Deep in the overlap the closest surface of either box is buried in the other one."""
    shift = np.array([1.5, 0, 0])
    points = np.concatenate([BOX, BOX + shift])
    triangles = np.concatenate([BOX_TRIANGLES, BOX_TRIANGLES[:, ::-1] + len(BOX)])
    body = body_surface(points, triangles)
    queries = [0.75, 0.5, 0.2] + 0.1 * POINTS[:50]
    closest = body.closest(queries)
    np.testing.assert_allclose(closest.signed_distance, -(1 - np.abs(queries[:, 1:]).max(axis=1)), atol=1e-9)
    assert not np.isin(closest.triangles, np.setdiff1d(np.arange(len(triangles)), body.outer)).any()


def test_an_open_body_has_an_inside():
    """A ball without its cap: the sign holds but near the hole."""
    kept = BALL_TRIANGLES[BALL[BALL_TRIANGLES][:, :, 2].mean(axis=1) < 0.42]
    body = body_surface(BALL, kept)
    assert body.open_edges > 0
    assert body_surface(BALL, BALL_TRIANGLES).open_edges == 0
    low = POINTS[POINTS[:, 2] < 0.1]
    np.testing.assert_array_equal(body.closest(low).inside, body_surface(BALL, BALL_TRIANGLES).closest(low).inside)


def test_a_flat_sheet_has_no_inside():
    sheet, triangles = GENERATORS["rectangle"](cells=(3, 3))
    with pytest.raises(TransferError):
        body_surface(sheet, triangles)


def test_bad_arrays_are_named():
    broken = BALL.copy()
    broken[7, 1] = np.nan
    with pytest.raises(TransferError, match=r"body positions\[7\]"):
        body_surface(broken, BALL_TRIANGLES)
    with pytest.raises(TransferError, match=r"triangle 2\b.*999999"):
        body_surface(BALL, np.array([[0, 1, 2], [0, 2, 3], [0, 1, 999999]]))
    with pytest.raises(TransferError, match="points"):
        body_surface(BALL, BALL_TRIANGLES).closest(np.zeros(3))


def test_penetration_names_the_deepest():
    body = body_surface(BOX, BOX_TRIANGLES)
    found = body.penetration(np.array([[0, 0, 3.0], [0, 0, 0.9], [0, 0.4, 0], [1.5, 0, 0]]))
    assert (found.count, found.worst) == (2, 2)
    assert found.depth == pytest.approx(0.6)
    nothing = body.penetration(np.array([[0, 0, 3.0]]))
    assert (nothing.count, nothing.depth, nothing.worst) == (0, 0.0, -1)
    assert body.penetration(np.zeros((0, 3))).count == 0


def test_rays_leave_the_body():
    body = body_surface(BOX, BOX_TRIANGLES)
    distance, triangle = body.exits(np.array([[0.1, 0.2, 0.3], [3.0, 0, 0]]), np.array([[0, 1.0, 0], [1.0, 0, 0]]))
    assert distance[0] == pytest.approx(0.8)
    assert (BOX[BOX_TRIANGLES[triangle[0]]][:, 1] == 1).all()
    assert distance[1] == np.inf
    assert triangle[1] == -1
