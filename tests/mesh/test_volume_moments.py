"""Volume moments against closed forms and the divergence theorem's invariances."""

import numpy as np
import pytest

from clothsim.mesh.generators.shapes import ring, slab, sphere
from clothsim.mesh.motion import rotation_matrix
from clothsim.mesh.rigid_body import volume_moments

TURN = rotation_matrix(np.array([0.3, -1.1, 0.7]))
SHIFT = np.array([5.0, -3.0, 2.0])


def test_a_box_has_the_moments_of_a_box():
    size = np.array([0.2, 0.5, 0.9])
    positions, triangles = slab(size, (2, 1, 3))
    moments = volume_moments(positions @ TURN.T + SHIFT, triangles)
    assert moments.volume == pytest.approx(size.prod(), rel=1e-13)
    assert moments.centroid == pytest.approx(SHIFT, abs=1e-13)
    assert moments.covariance == pytest.approx(TURN @ np.diag(size**2 / 12) @ TURN.T, abs=1e-13)


def test_a_ball_converges_to_the_moments_of_a_ball():
    off = []
    for subdivisions in (3, 4):
        moments = volume_moments(*sphere(1.0, subdivisions))
        off.append([moments.volume / (4 * np.pi / 3) - 1, moments.covariance[0, 0] / 0.2 - 1])
    assert np.allclose(np.divide(*off), 4.0, rtol=0.05)
    assert np.abs(off[1]).max() < 0.01


def test_a_ring_converges_to_the_moments_of_a_torus():
    radius, half = 0.05, 0.01
    moments = volume_moments(*ring(radius, 2 * half, 96, 48))
    assert moments.volume == pytest.approx(2 * np.pi**2 * radius * half**2, rel=0.01)
    assert moments.covariance[2, 2] == pytest.approx(half**2 / 4, rel=0.01)
    assert moments.covariance[0, 0] == pytest.approx(0.5 * radius**2 + 3 * half**2 / 8, rel=0.01)


def test_a_surface_that_faces_inwards_has_a_negative_volume():
    positions, triangles = slab((1.0, 1.0, 1.0))
    assert volume_moments(positions, triangles[:, ::-1]).volume == pytest.approx(-1.0)
