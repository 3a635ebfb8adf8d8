"""Closed form of the arc that bends and twists against an integration of its beam, and a small form of its scene."""

import numpy as np
import pytest
from scipy.integrate import solve_bvp

from tests.known_answers.a15_bending_scenes import ARC, arc_drop, arc_tip, plastic_tip
from tests.known_answers.plastic_strip import tip_of_beam


@pytest.mark.parametrize("twisting", [0.5, 2.0])
def test_the_drop_of_an_arc_is_that_of_its_equilibrium(twisting):
    """A level arc of radius 1 under a load of 1, clamped at 0: w the drop, a = w' and b the roll.

    M = b - a' and T = GJ (b' + a) do work on them; Q' = 1, M' = -Q - T, T' = M, and all three vanish at the tip.
    """

    def slopes(_, y):
        _, a, b, moment, torque, shear = y
        return np.array([a, b - moment, torque / twisting - a, -shear - torque, moment, np.ones_like(a)])

    def ends(at_clamp, at_tip):
        return np.array([*at_clamp[:3], *at_tip[3:]])

    s = np.linspace(0, np.pi / 2, 41)
    found = solve_bvp(slopes, ends, s, np.zeros((6, 41)), tol=1e-8)
    assert found.success
    assert found.y[0, -1] == pytest.approx(arc_drop(1.0, twisting), rel=1e-6)


def test_a_coarse_arc_sinks_as_the_beam_but_for_its_clamp():
    assert arc_tip(0.1, 2) == pytest.approx(arc_drop(*ARC), rel=0.01)


def test_a_coarse_cantilever_keeps_its_crease():
    assert plastic_tip(10) == pytest.approx(tip_of_beam(), rel=0.1)
