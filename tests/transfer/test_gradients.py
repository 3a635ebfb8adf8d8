"""Deformation gradients: exact for affine maps, linear in the positions and fourth vertices."""

import numpy as np
import pytest

from clothsim.mesh.generators.table import GENERATORS
from transfer.errors import TransferError
from transfer.gradients import deformation_gradients, gradient_operator, inverse_frames, plane_operator

BALL, TRIANGLES = GENERATORS["sphere"](radius=0.7, subdivisions=2)
RNG = np.random.default_rng(3)
WILD = BALL + 0.05 * RNG.normal(size=BALL.shape)


def frames(positions, triangles):
    """V = [e1 e2 v4-v1], its vectors in columns (Sumner & Popovic 2004, eq. 2 and 3)."""
    a, b, c = (positions[triangles[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    return np.stack([b - a, c - a, normal / np.sqrt(np.linalg.norm(normal, axis=1))[:, None]], axis=2)


def test_the_gradient_takes_the_frame_at_rest_to_the_deformed_one():
    found = deformation_gradients(inverse_frames(BALL, TRIANGLES, "ball"), WILD, TRIANGLES)
    np.testing.assert_allclose(found @ frames(BALL, TRIANGLES), frames(WILD, TRIANGLES), atol=1e-12)


def test_a_rotation_and_scale_is_its_own_gradient():
    rotation = np.linalg.qr(RNG.normal(size=(3, 3)))[0]
    rotation *= np.sign(np.linalg.det(rotation))
    found = deformation_gradients(inverse_frames(BALL, TRIANGLES, "ball"), 2.5 * BALL @ rotation.T + 3, TRIANGLES)
    # the fourth vertex is a length away, not an area: it scales with the rest
    np.testing.assert_allclose(found, np.broadcast_to(2.5 * rotation, found.shape), atol=1e-12)


def test_an_affine_map_is_met_in_the_plane_but_not_along_the_normal():
    affine = np.eye(3) + 0.3 * RNG.normal(size=(3, 3))
    found = deformation_gradients(inverse_frames(BALL, TRIANGLES, "ball"), BALL @ affine.T, TRIANGLES)
    edges = frames(BALL, TRIANGLES)[:, :, :2]
    np.testing.assert_allclose(found @ edges, affine @ edges, atol=1e-12)
    assert np.abs(found - affine).max() > 0.1


def test_the_operator_gives_the_gradients_of_any_deformation():
    inverses = inverse_frames(BALL, TRIANGLES, "ball")
    fourth = WILD[TRIANGLES[:, 0]] + frames(WILD, TRIANGLES)[:, :, 2]
    product = gradient_operator(inverses, TRIANGLES, len(BALL)) @ np.vstack([WILD, fourth])
    found = product.reshape(-1, 3, 3).transpose(0, 2, 1)
    np.testing.assert_allclose(found, deformation_gradients(inverses, WILD, TRIANGLES), atol=1e-11)


def test_the_plane_operator_is_the_gradient_without_the_normal():
    inverses = inverse_frames(BALL, TRIANGLES, "ball")
    found = (plane_operator(inverses, TRIANGLES, len(BALL)) @ WILD).reshape(-1, 3, 3).transpose(0, 2, 1)
    normal = frames(BALL, TRIANGLES)[:, :, 2]
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    plane = np.eye(3) - normal[:, :, None] * normal[:, None, :]
    np.testing.assert_allclose(found, deformation_gradients(inverses, WILD, TRIANGLES) @ plane, atol=1e-11)


@pytest.mark.parametrize("third", [(2.0, 0, 0), (1.0, 0, 0), (0.5, 1e-10, 0)])
def test_a_triangle_without_area_is_named(third):
    positions = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], third], dtype=float)
    with pytest.raises(TransferError, match=r"triangle 1\b.*thing.*\[0, 1, 3\]"):
        inverse_frames(positions, np.array([[0, 1, 2], [0, 1, 3]]), "the thing")


def test_units_change_nothing():
    for unit in (1e-6, 1e6):
        inverses = inverse_frames(unit * BALL, TRIANGLES, "ball")
        found = deformation_gradients(inverses, unit * BALL, TRIANGLES)
        np.testing.assert_allclose(found, np.broadcast_to(np.eye(3), found.shape), atol=1e-12)
