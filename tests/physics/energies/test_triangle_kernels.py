"""Half angles and projected 2x2 matrices against numpy's own."""

import numpy as np
import pytest

from clothsim.physics.energies.triangle_kernels import half_angle, project_2x2

SCALES = (1e-100, 1e-12, 1.0, 1e12)


@pytest.mark.parametrize("scale", SCALES)
def test_half_angles_are_those_of_atan2(scale):
    rng = np.random.default_rng(0)
    ways = [*rng.normal(size=(50, 2)), (0.0, 1.0), (0.0, -1.0), (1.0, 0.0), (-1.0, 0.0), (1e-9, -1.0), (-1e-9, 1.0)]
    for y, x in ways:
        angle = 0.5 * np.arctan2(y, x)
        assert half_angle(scale * y, scale * x) == pytest.approx((np.cos(angle), np.sin(angle)), abs=1e-15)


def test_no_way_has_no_angle():
    assert half_angle(0.0, 0.0) == (1.0, 0.0)


@pytest.mark.parametrize("scale", SCALES)
def test_a_projected_2x2_matrix_is_that_of_its_eigenvalues(scale):
    rng = np.random.default_rng(1)
    special = [(1, 0, 1), (-1, 0, -1), (0, 0, 0), (1, 0, -1), (0, 1, 0), (1, 1, 1), (-1, -1, -1), (1, 1e-9, 1)]
    for a, b, c in [*rng.normal(size=(50, 3)), *special]:
        values, vectors = np.linalg.eigh([[a, b], [b, c]])
        nearest = vectors * np.maximum(values, 0) @ vectors.T
        expected = scale * nearest[0, 0], scale * nearest[0, 1], scale * nearest[1, 1]
        assert project_2x2(scale * a, scale * b, scale * c) == pytest.approx(expected, abs=2e-15 * scale, rel=1e-14)
