"""Backward Euler: free fall, free flight, the energy inequality of a step, order (docs/results/validation.md A4)."""

import numpy as np
import pytest
from solving import NOTHING, newton_of, run_of, those_on

from tests.known_answers.a4_time import (
    GRAVITY,
    energy_gained,
    falling,
    momentum_drift,
    newton_of_translation,
    ringing_error,
    sheet,
    tumbling,
)
from tests.support.effect_builders import inertia, membrane


@pytest.mark.parametrize("dt", [0.1, 0.02])
def test_free_fall_is_late_by_exactly_half_a_step(dt):
    velocity = np.array([1.0, 2.0, 3.0])
    integrator = falling("backward_euler", dt, tuple(velocity))
    T = 0.4
    end = run_of(integrator, T)[-1].state
    fallen = end.positions - integrator.world.start() - velocity * T
    assert np.abs(fallen - GRAVITY * T**2 / 2 - GRAVITY * T * dt / 2).max() < 1e-12
    assert np.abs(end.velocities - velocity - GRAVITY * T).max() < 1e-10


def test_rigid_translation_takes_one_newton_iteration():
    """With a tolerance above the speed the first iteration is the last, and it is exact."""
    assert newton_of_translation() == 1
    world = sheet(velocity=(3.0, -2.0, 1.0))
    energies = those_on(inertia=inertia(world), membrane=membrane(world))
    newton = newton_of(world, energies, dt=0.1, velocities=world.start_velocities(), tolerance=100.0)
    result = newton.minimise(world.start(), NOTHING)
    assert result.outcome.converged
    assert np.abs(result.x - world.start() - [0.3, -0.2, 0.1]).max() < 1e-13


def test_nothing_happens_to_a_sheet_at_rest():
    world = sheet()
    energies = those_on(inertia=inertia(world), membrane=membrane(world))
    result = newton_of(world, energies, dt=0.1).minimise(world.start(), NOTHING)
    assert result.outcome.converged
    assert result.iterations <= 1
    assert np.abs(result.x - world.start()).max() < 1e-15


def test_free_flight_keeps_linear_momentum():
    assert momentum_drift() < 1e-12


@pytest.mark.parametrize("dt", [0.02, 0.2, 2.0])
def test_energy_inequality_of_every_unforced_step(dt):
    """|v(n+1) - v(n)|_M^2/2 + Psi(n+1) <= |v(n)|_M^2/2 + Psi(n): the minimiser is no worse than staying at x(n)."""
    assert energy_gained(dt) <= 1e-12


def test_the_tumbling_sheet_is_strained_and_moves():
    world, energies = tumbling()
    assert energies["membrane"].value(world.start()) > 1e-3
    assert np.ptp(world.start_velocities(), axis=0).max() == 0


def test_backward_euler_is_of_first_order():
    """Against the same masses and springs integrated by an explicit method of order 8."""
    errors = np.array([ringing_error("backward_euler", dt) for dt in (0.02, 0.01, 0.005)])
    orders = np.log2(errors[:-1] / errors[1:])
    assert (orders > 0.9).all()
    assert (orders < 1.1).all()
