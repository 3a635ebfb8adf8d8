"""Rigid part of displacements: rigid ones are kept, deformations left out, each object by itself."""

import numpy as np
import pytest

from clothsim.physics.contact.anchors import rigid_displacements

LABELS = np.repeat([0, 3], [12, 8])


@pytest.fixture
def x():
    return np.random.default_rng(4).normal(0, 0.2, (20, 3))


def test_each_object_keeps_its_own_motion(x):
    moved = np.where(LABELS[:, None] == 0, np.cross([0.02, 0.0, 0.01], x) + 0.1, np.cross([0, -0.03, 0], x))
    np.testing.assert_allclose(rigid_displacements(x, moved, LABELS), moved, rtol=0, atol=1e-15)


def test_the_remainder_has_no_momentum(x):
    displacements = np.random.default_rng(5).normal(0, 0.01, x.shape)
    left = displacements - rigid_displacements(x, displacements, LABELS)
    for label in (0, 3):
        rows = label == LABELS
        assert np.abs(left[rows].sum(axis=0)).max() < 1e-15
        assert np.abs(np.cross(x[rows] - x[rows].mean(axis=0), left[rows]).sum(axis=0)).max() < 1e-15
    assert np.abs(left).max() > 1e-3


def test_points_on_a_line_do_not_turn_about_it():
    x = np.linspace(0, 1, 5)[:, None] * [1.0, 0, 0]
    found = rigid_displacements(x, np.cross([0.5, 0.1, 0.0], x), np.zeros(5, int))
    np.testing.assert_allclose(found, np.cross([0, 0.1, 0], x), rtol=0, atol=1e-15)
