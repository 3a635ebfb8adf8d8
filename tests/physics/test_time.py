"""Backward Euler: free fall, free flight, the energy inequality of a step, and the order (VALIDATION A4)."""

from dataclasses import replace

import numpy as np
import pytest
from meshes import cloth, deformed, irregular_grid, small_world
from ringing import ringing
from solving import NOTHING, integrator_of, newton_of, run_of

from clothsim.energies.bending import bending
from clothsim.energies.gravity import gravity
from clothsim.energies.inertia import inertia
from clothsim.energies.membrane import membrane
from clothsim.mesh.world import make_world

G = np.array([0.3, -0.5, -9.81])


def sheet(positions=None, velocity=(0.0, 0.0, 0.0)):
    rest, triangles = irregular_grid()
    one = replace(cloth(rest, triangles, velocity=velocity), positions=rest if positions is None else positions)
    return make_world([one])


def effects(world, *more):
    return {"inertia": inertia(world), "membrane": membrane(world), "bending": bending(world)} | dict(more)


@pytest.mark.parametrize("dt", [0.1, 0.02])
def test_free_fall_is_late_by_exactly_half_a_step(dt):
    velocity = np.array([1.0, 2.0, 3.0])
    world = sheet(velocity=velocity)
    integrator = integrator_of(world, effects(world, ("gravity", gravity(world, acceleration=G))), dt, tolerance=1e-9)
    T = 0.4
    end = run_of(integrator, T)[-1].state
    fallen = end.positions - world.start() - velocity * T
    assert np.abs(fallen - G * T**2 / 2 - G * T * dt / 2).max() < 1e-12
    assert np.abs(end.velocities - velocity - G * T).max() < 1e-10


def test_rigid_translation_takes_one_newton_iteration():
    """With a tolerance above the speed the first iteration is the last, and it is exact."""
    world = sheet(velocity=(3.0, -2.0, 1.0))
    newton = newton_of(world, effects(world), dt=0.1, velocities=world.start_velocities(), tolerance=100.0)
    x = world.start()
    result = newton.minimise(x, NOTHING)
    assert result.outcome.converged
    assert result.iterations == 1
    assert np.abs(result.x - x - [0.3, -0.2, 0.1]).max() < 1e-13


def test_nothing_happens_to_a_sheet_at_rest():
    world = sheet()
    result = newton_of(world, effects(world), dt=0.1).minimise(world.start(), NOTHING)
    assert result.outcome.converged
    assert result.iterations <= 1
    assert np.abs(result.x - world.start()).max() < 1e-15


def tumbling():
    """A sheet that starts strained, bent and thrown."""
    rest = small_world()
    return sheet(positions=deformed(rest, amplitude=0.06), velocity=(1.0, -2.0, 0.5))


def test_free_flight_keeps_linear_momentum():
    world = tumbling()
    reports = run_of(integrator_of(world, effects(world), 0.05, tolerance=1e-9), 1.0)
    assert len(reports) == 20
    momentum = np.array([world.masses @ report.state.velocities[: world.n_cloth] for report in reports])
    exact = world.masses.sum() * np.array([1.0, -2.0, 0.5])
    assert np.abs(momentum - exact).max() < 1e-12 * np.abs(exact).max() * 20
    spread = np.abs(reports[-1].state.velocities - [1.0, -2.0, 0.5]).max()
    assert spread > 0.01


@pytest.mark.parametrize("dt", [0.02, 0.2, 2.0])
def test_energy_inequality_of_every_unforced_step(dt):
    """|v(n+1) - v(n)|_M^2/2 + Psi(n+1) <= |v(n)|_M^2/2 + Psi(n): the minimiser is no worse than staying at x(n)."""
    world = tumbling()
    integrator = integrator_of(world, effects(world), dt, tolerance=1e-9)
    elastic = [membrane(world), bending(world)]

    def psi(x):
        return sum(energy.value(x) for energy in elastic)

    def kinetic(v):
        return 0.5 * float(world.masses @ (v**2).sum(axis=1))

    x, v = world.start(), world.start_velocities()
    lost = []
    for report in run_of(integrator, 10 * dt):
        after = report.state
        before = kinetic(v) + psi(x)
        assert kinetic(after.velocities - v) + psi(after.positions) <= before * (1 + 1e-12)
        lost.append(before - kinetic(after.velocities) - psi(after.positions))
        x, v = after.positions, after.velocities
    assert sum(lost) > 1e-4


def test_backward_euler_is_of_first_order():
    """Against the same masses and springs integrated by an explicit method of order 8."""
    world, energies, exact = ringing()
    errors = []
    for dt in (0.02, 0.01, 0.005):
        x = run_of(integrator_of(world, energies, dt, tolerance=1e-8), 0.8)[-1].state.positions
        errors.append(np.abs(x - exact).max())
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert (orders > 0.9).all()
    assert (orders < 1.1).all()
