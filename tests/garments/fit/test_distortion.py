"""Distortion of a fit with known stretch."""

import numpy as np
import pytest

from clothsim.garments.fit.wear_check import cost_of
from clothsim.garments.inputs import Garment
from clothsim.mesh.generators.shapes import rectangle

GARMENT = Garment("sheet", *rectangle(size=(1.0, 1.0), cells=(5, 5)))


def test_a_uniform_stretch_is_found_in_every_triangle():
    moved = GARMENT.positions * [1.25, 0.8, 1.0]
    cost = cost_of(GARMENT, moved)
    np.testing.assert_allclose(cost.stretches, np.tile([1.25, 0.8], (50, 1)), rtol=1e-12)
    assert (cost.low, cost.high) == pytest.approx((0.8, 1.25))
    assert cost.displacement == pytest.approx(np.hypot(0.5 * 0.25, 0.5 * 0.2))


def test_a_rigid_motion_costs_no_stretch():
    turned = GARMENT.positions[:, [2, 0, 1]] + np.array([0.0, 0.0, 3.0])
    cost = cost_of(GARMENT, turned)
    np.testing.assert_allclose(cost.stretches, 1.0, rtol=1e-12)
    assert cost.displacement > 2.9
    assert set(cost.as_dict()) == {"stretch_low", "stretch_high", "displacement"}


def test_the_percentiles_leave_one_bad_triangle_out():
    positions, triangles = rectangle(size=(1.0, 1.0), cells=(20, 20))
    spiked = positions.copy()
    spiked[triangles[0, 0], 2] = 1.0
    cost = cost_of(Garment("sheet", positions, triangles), spiked)
    assert cost.stretches.max() > 10
    assert cost.high == pytest.approx(1.0)
