"""Boundary value problems of loops and lifted strips against chains of links of least energy; no equation is shared."""

import numpy as np
import pytest
from scipy.optimize import minimize

from tests.known_answers.a11_strips import loop_depth
from tests.known_answers.loops import depth_of_heart, heart_loop, lifted_strip, pinched_ring

LINKS = 30


def chain(length, weight, curvature, clamps, end_x=None, end_z=None, above=False):
    """Energy of a chain of LINKS links of least energy, x and z of its joints from (0, 0).

    clamps: angle at each end, None where it is free; end_x, end_z: where its end is held; above: no joint is below 0.
    """
    h = length / LINKS
    to_joints = h * np.tril(np.ones((LINKS, LINKS)))

    def joints(angles):
        return to_joints @ np.cos(angles), to_joints @ np.sin(angles)

    def slopes(angles):
        return -to_joints * np.sin(angles), to_joints * np.cos(angles)

    def held(axis, place):
        return {
            "type": "eq",
            "fun": lambda angles: joints(angles)[axis][-1] - place,
            "jac": lambda angles: slopes(angles)[axis][-1],
        }

    def energy(angles):
        turns = np.diff(angles) - curvature * h
        total, slope = (turns**2).sum() / (2 * h), np.zeros(LINKS)
        slope[1:] += turns / h
        slope[:-1] -= turns / h
        for end, clamp, sign in ((0, clamps[0], 1), (-1, clamps[1], -1)):
            if clamp is not None:  # half a link from the clamp
                turn = sign * (angles[end] - clamp) - curvature * h / 2
                total, slope[end] = total + turn**2 / h, slope[end] + sign * 2 * turn / h
        lever = h * (np.arange(LINKS)[::-1] + 0.5)
        total += weight * h * (lever * np.sin(angles)).sum()
        return total, slope + weight * h * lever * np.cos(angles)

    constraints = [held(axis, place) for axis, place in enumerate((end_x, end_z)) if place is not None]
    if above:
        constraints.append({"type": "ineq", "fun": lambda x: joints(x)[1], "jac": lambda x: slopes(x)[1]})
    first, last = (0.0 if clamp is None else clamp for clamp in clamps)
    start = np.linspace(first, last, LINKS) + 1e-3
    found = minimize(
        energy, start, jac=True, method="SLSQP", constraints=constraints, options={"maxiter": 500, "ftol": 1e-12}
    )
    assert found.success, found.message
    return found.fun, *joints(found.x)


@pytest.mark.parametrize("weight", [50.0, 200.0])
def test_a_heart_loop_is_a_chain_of_least_energy(weight):
    gap = 0.01
    _, _, z = chain(0.5, weight, 0.0, (np.pi / 2, -np.pi), end_x=-gap / 2)
    assert depth_of_heart(weight, gap) == pytest.approx(-z[-1], rel=5e-3)


def test_a_weightless_heart_loop_is_as_deep_as_peirce_says():
    assert depth_of_heart(0.0, 0.0) == pytest.approx(0.1337, abs=2e-4)
    assert heart_loop(50.0, 0.01).rows[2].min() > -1e-12  # its halves do not cross


def test_a_pinched_ring_is_a_chain_of_least_energy_and_small_loads_agree_with_timoshenko():
    force, width = pinched_ring(0.75)
    found = {height: chain(np.pi / 2, 0.0, -1.0, (0.0, -np.pi / 2), end_z=-height) for height in (0.74, 0.75, 0.76)}
    assert width == pytest.approx(found[0.75][1][-1], rel=1e-3)
    # four quarters; the height of the whole ring is twice that of a quarter
    assert force == pytest.approx(4 * (found[0.74][0] - found[0.76][0]) / 0.04, rel=2e-3)
    assert pinched_ring(0.999)[0] * (np.pi / 4 - 2 / np.pi) / 2 == pytest.approx(1e-3, rel=5e-3)


def test_a_lifted_strip_is_a_chain_of_least_energy_and_a_shallow_one_agrees_with_the_beam():
    strip, length = lifted_strip(1.0), 4.0
    found = {height: chain(length, 1.0, 0.0, (None, None), end_z=height, above=True) for height in (0.95, 1.0, 1.05)}
    assert strip.unknowns.sum() == pytest.approx((found[1.05][0] - found[0.95][0]) / 0.1, rel=5e-3)
    s = length * (np.arange(LINKS) + 1) / LINKS
    above = length - np.interp(0.1, found[1.0][2], s)
    assert strip.s[-1] - strip.where(0.1) == pytest.approx(above, rel=5e-3)
    shallow = lifted_strip(0.01)
    assert shallow.s[-1] == pytest.approx(0.24**0.25, rel=1e-4)
    assert shallow.unknowns.sum() == pytest.approx(0.24**0.25 / 2, rel=3e-4)


@pytest.mark.parametrize("dt", [1.0, 0.1])
def test_a_loop_hangs_as_deep_in_one_step_of_its_load_as_in_many(dt):
    """With a stop of 1 mm/s, in a step of 1 s, it was called completed 10 % off."""
    assert loop_depth(50.0, 20, dt) == pytest.approx(depth_of_heart(50.0, 0.01), rel=5e-3)
