"""Armijo backtracking: sufficient decrease, the step limit, step extension."""

import numpy as np
import pytest
from differences import numeric_gradient
from effect_builders import membrane
from meshes import deformed, small_world

from clothsim.physics.energies.base import Energy
from clothsim.solve.newton.line_search import MAX_HALVINGS, SUFFICIENT_DECREASE, armijo, extended_fraction
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
