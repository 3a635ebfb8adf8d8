"""Armijo backtracking: sufficient decrease, the step limit, step extension."""

from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np
import pytest
from differences import numeric_gradient
from effect_builders import membrane
from meshes import deformed, small_world

from clothsim.physics.energies.base import Energy
from clothsim.solve.newton.direction import CachedFactor
from clothsim.solve.newton.line_search import (
    LONGEST,
    MAX_HALVINGS,
    SUFFICIENT_DECREASE,
    CurvedStep,
    are_parallel,
    armijo,
    curved_step,
    extended_fraction,
    fraction_along,
    longer_step,
)
from clothsim.solve.newton.potential import Potential
from clothsim.solve.timers import Timers


def sheet():
    world = small_world()
    x = deformed(world)
    potential = Potential({"membrane": membrane(world)}, Timers())
    return potential, x, -potential.gradient(x)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 30.0])
@pytest.mark.parametrize("limit", [1.0, 0.3])
def test_the_step_lowers_the_energy_enough_and_its_double_does_not(scale, limit):
    potential, x, downhill = sheet()
    dx = scale * downhill
    slope = float(np.vdot(potential.gradient(x), dx))
    fraction = armijo(potential, x, dx, slope, limit)
    start = potential.value(x)

    def enough(a):
        return potential.value(x + a * dx) <= start + SUFFICIENT_DECREASE * a * slope

    assert 0 < fraction <= limit
    assert enough(fraction)
    halvings = np.log2(limit / fraction)
    assert halvings == int(halvings)
    assert fraction == limit or not enough(2 * fraction)


def test_a_direction_that_climbs_gives_nothing_after_a_bounded_number_of_tries():
    potential, x, downhill = sheet()
    assert np.abs(numeric_gradient(membrane(small_world()), x) + downhill).max() < 1e-6
    assert armijo(potential, x, -downhill, -1.0, 1.0) == 0.0
    assert potential.timers.effects["membrane"].evaluations == MAX_HALVINGS + 1


def test_infinite_energies_are_stepped_back_from():
    potential, x, downhill = sheet()
    world = small_world()
    collapse = x[world.triangles[0, 0]] - x  # at fraction 1 all vertices meet in one point
    assert potential.value(x + collapse) == np.inf
    slope = float(np.vdot(-downhill, collapse))
    fraction = armijo(potential, x, collapse, -abs(slope), 1.0)
    assert fraction < 1
    assert np.isfinite(potential.value(x + fraction * collapse))


def test_a_rise_within_round_off_is_no_rise():
    world = small_world()
    potential = Potential({"membrane": membrane(world)}, Timers())
    x = world.start() * 1.2
    assert armijo(potential, x, np.zeros_like(x), -1e-30, 1.0) == 1.0


@pytest.mark.parametrize("limit", [1.0, 3.0, 32.0])
def test_a_step_is_lengthened_while_the_energy_falls_and_no_further(limit):
    potential, x, downhill = sheet()
    dx = 1e-4 * downhill
    fraction = extended_fraction(potential, x, dx, limit)
    assert 1.0 <= fraction <= limit
    values = [potential.value(x + a * dx) for a in 2.0 ** np.arange(6)]
    reached = int(np.log2(fraction))
    assert (np.diff(values[: reached + 1]) < 0).all()
    assert 2 * fraction > limit or values[reached + 1] >= values[reached]


def test_a_step_past_the_valley_is_not_lengthened():
    potential, x, downhill = sheet()
    assert extended_fraction(potential, x, 10.0 * downhill, 32.0) == 1.0


class Wall(Energy):
    """Nothing but a collision: no step goes further than `reach` [m]."""

    def __init__(self, reach):
        self.reach = reach

    def value(self, x):
        return 0.0

    def gradient(self, x):
        return np.zeros_like(x)

    def hessian(self, x, project=True):
        raise NotImplementedError

    def step_limit(self, x, dx, most=1.0):
        return min(most, self.reach / float(np.abs(dx).max()))


def test_a_step_is_lengthened_as_far_as_it_is_free():
    potential, x, downhill = sheet()
    dx = 1e-4 * downhill
    free = extended_fraction(potential, x, dx, 32.0)
    assert free >= 8.0
    wall = Wall(5.0 * float(np.abs(dx).max()))
    assert extended_fraction(Potential({**potential.energies, "wall": wall}, Timers()), x, dx, 32.0) == 4.0


STIFF, PULL = 1e4, 1.0
"""Of a rod of length 1 to the origin [N/m], and the force along y on its end [N]."""


@dataclass(frozen=True)
class Rod(Energy):
    """k (|x| - 1)^2 / 2 - f y: a valley along the unit circle, downhill towards (0, 1, 0)."""

    limit: float = 1.0
    """What contact allows of every step beyond .3 m."""

    def value(self, x):
        return float((0.5 * STIFF * (np.linalg.norm(x, axis=1) - 1.0) ** 2 - PULL * x[:, 1]).sum())

    def gradient(self, x):
        length = np.linalg.norm(x, axis=1, keepdims=True)
        return STIFF * (length - 1.0) * x / length - PULL * np.array([0.0, 1.0, 0.0])

    def hessian(self, x, project=True):
        raise NotImplementedError

    def step_limit(self, x, dx, most=1.0):
        return min(most, self.limit) if np.abs(dx).max() > 0.3 else most


@dataclass(frozen=True)
class Hollow(Rod):
    """|x - bottom|^2 / 2."""

    bottom: np.ndarray = field(default_factory=lambda: np.zeros((1, 3)))

    def value(self, x):
        return 0.5 * float(((x - self.bottom) ** 2).sum())


X = np.array([[1.0, 0.0, 0.0]])
TANGENT = np.array([[0.0, 1.0, 0.0]])


def potential(**keys):
    return Potential({"rod": Rod(**keys)}, Timers())


def stiff_inverse(forces):
    """Inverse of the projected Hessian at X, with a kilonewton per metre across the rod."""
    return forces / np.array([STIFF, 1e3, 1e3])


@pytest.mark.parametrize("length", [0.01, 0.1])
def test_the_bend_is_the_centripetal_one(length):
    dx = length * TANGENT
    path = curved_step(potential(), X, dx, potential().gradient(X), stiff_inverse)
    assert path.bend == pytest.approx(np.array([[-(length**2), 0.0, 0.0]]), rel=0.3 * length**2, abs=1e-13)


def test_the_path_leaves_the_valley_with_the_fourth_power():
    path = CurvedStep(TANGENT, np.array([[-1.0, 0.0, 0.0]]))
    off = np.array([np.linalg.norm(X + path.at(a)) - 1.0 for a in (0.1, 0.05, 0.025)])
    straight = np.array([np.linalg.norm(X + a * TANGENT) - 1.0 for a in (0.1, 0.05, 0.025)])
    assert np.log2(off[:-1] / off[1:]) == pytest.approx(4.0, abs=0.02)
    assert np.log2(straight[:-1] / straight[1:]) == pytest.approx(2.0, abs=0.02)


def test_a_step_along_the_curve_goes_further_and_lower_than_the_straight_one():
    ours, dx = potential(), 0.05 * TANGENT
    slope = float(np.vdot(ours.gradient(X), dx))
    path = curved_step(ours, X, dx, ours.gradient(X), stiff_inverse)
    along = fraction_along(ours, X, path, slope, 1.0)
    assert 4.0 <= along <= LONGEST
    assert ours.value(X + path.at(along)) < ours.value(X + path.at(0.5 * along)) < ours.value(X + dx)


@pytest.mark.parametrize(("bottom", "wanted"), [(0.985, 0.0), (1.6, 2.0), (2.9, 2.0), (3.1, 4.0), (100.0, LONGEST)])
def test_the_fraction_is_doubled_while_the_energy_falls(bottom, wanted):
    """On a straight path, whose first step is no gain over itself: from 1 by powers of two towards the bottom."""
    dx, path = 0.02 * TANGENT, CurvedStep(0.02 * TANGENT, np.zeros((1, 3)))
    ours = Potential({"hollow": Hollow(bottom=X + bottom * dx)}, Timers())
    assert fraction_along(ours, X, path, -bottom * float(np.vdot(dx, dx)), 1.0 if wanted == 0.0 else 0.5) == wanted


def model():
    """A quadratic model that solves with `stiff_inverse`."""
    return SimpleNamespace(solver=lambda cached: stiff_inverse)


def direction(ours, dx):
    return SimpleNamespace(dx=dx, gradient=ours.gradient(X), cached=CachedFactor(), negative_curvature=True)


@pytest.mark.parametrize("case", ["parallel", "first", "turned", "clipped", "contact"])
def test_only_a_step_that_repeats_the_one_before_is_curved(case):
    ours = potential(limit=0.5 if case == "contact" else 1.0)
    dx = 0.16 * TANGENT
    previous = {"first": 0.0 * dx, "turned": dx[:, [0, 2, 1]]}.get(case, 0.5 * dx)
    step, fraction = longer_step(ours, X, model(), direction(ours, dx), previous, 0.5, case != "clipped")
    curved = {"parallel": True, "contact": True}.get(case, False)
    assert (step[0, 0] < 0.0) == curved
    assert fraction == 0.5 or curved
    assert np.abs(step).max() <= 0.3 or case != "contact"  # no collision on it, whatever it gains
    assert ours.value(X + step) <= ours.value(X + 0.5 * dx)


def test_a_bend_longer_than_the_step_is_none():
    dx = 1.5 * TANGENT
    assert curved_step(potential(), X, dx, potential().gradient(X), lambda forces: forces) is None
    with np.errstate(invalid="ignore"):
        assert curved_step(potential(), X, np.nan * dx, potential().gradient(X), stiff_inverse) is None


def test_parallel_is_a_matter_of_angle_alone():
    assert are_parallel(1e-9 * TANGENT, TANGENT + 0.3 * X)
    assert not are_parallel(TANGENT, TANGENT + 0.4 * X)
    assert not are_parallel(TANGENT, -TANGENT)
    assert not are_parallel(TANGENT, np.zeros((1, 3)))
