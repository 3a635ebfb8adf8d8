"""Damping: Rayleigh's closed forms, decay rates in time, and rigid motions that strain drags leave alone."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
from differences import dense_hessian, gradient_error, hessian_error
from effect_builders import damping, inertia, membrane
from meshes import UNIT, cloth, deformed, grid, small_world
from solving import integrator_of, run_of, step_at

from clothsim.base.errors import InputError
from clothsim.mesh.body import rotation_matrix
from clothsim.mesh.world import make_world
from clothsim.physics.energies.base import Off
from clothsim.physics.energies.damping import MassDamping, past_of
from clothsim.physics.energies.hinge_bending import hinge_bending
from clothsim.solve.stepping.integrators import bdf2_past
from clothsim.solve.stepping.state import Previous, first_state

STRAIN = {"rate": 0.0, "stiffness": 0.3, "strain_rate": 0.2}


def two_triangles():
    return make_world([cloth(*grid(1, 1))])


def turned(x, degrees):
    turn = rotation_matrix(np.radians(degrees) * np.array([0.6, 0.0, 0.8]))
    return (x - [0.3, 0.1, 0.0]) @ turn.T + np.array([0.2, -1.0, 0.5]) * degrees


def bdf2_step(before, now, dt_before, dt):
    """A step of BDF2 that comes from `before` over `now`."""
    zero = np.zeros_like(now)
    world = replace(first_state(small_world(), dt), positions=now, velocities=zero)
    past = bdf2_past(world, Previous(before, zero, dt_before), dt, dt / dt_before)
    return replace(step_at(now, dt=dt), multistep_past=past)


def test_rigid_motions_are_left_alone():
    world = small_world()
    x = deformed(world)
    for step in (step_at(x, dt=0.1), bdf2_step(turned(x, -25), x, 0.07, 0.1)):
        energy = damping(world, **STRAIN).begin(step)
        assert abs(energy.value(turned(x, 40))) < 1e-22
        assert np.abs(energy.gradient(turned(x, 40))).max() < 1e-11
        assert energy.value(1.1 * x) > 1e-3


def test_the_past_of_a_quantity_has_the_weights_of_the_positions():
    before, now = np.random.default_rng(0).standard_normal((2, 12, 3))
    step = bdf2_step(before, now, 0.05, 0.08)
    assert np.allclose(past_of(step, lambda x: x), step.past.positions, rtol=0, atol=1e-13)
    squares = past_of(step, lambda x: x**2)
    r = 0.08 / 0.05
    assert np.allclose(squares, ((1 + r) ** 2 * now**2 - r**2 * before**2) / (1 + 2 * r), rtol=0, atol=1e-12)


def test_forces_and_torques_balance():
    world = small_world()
    x = deformed(world)
    force = damping(world, **STRAIN).begin(step_at(deformed(world, seed=5), dt=0.1)).gradient(x)
    assert np.abs(force).max() > 0.01
    assert np.abs(force.sum(axis=0)).max() < 1e-12
    assert np.abs(np.cross(x, force).sum(axis=0)).max() < 1e-12


@pytest.mark.parametrize("keys", [{"stiffness": 0.3}, {"strain_rate": 0.2}, {"strain_rate": 0.2, "stiffness": 0.1}])
def test_derivatives_of_each_drag_alone(keys):
    world = small_world()
    energy = damping(world, rate=0.0, **keys).begin(step_at(deformed(world, seed=5), dt=0.1))
    assert gradient_error(energy, deformed(world)) < 1e-7
    assert hessian_error(energy, deformed(world)) < 1e-6


def test_stiffness_is_rayleighs_beta_k_at_rest():
    """In membrane and hinges: C = h d2E/dx2 = beta K."""
    world, beta, dt = small_world(), 0.3, 0.1
    x = world.start()
    stiffness = dense_hessian(membrane(world), x) + dense_hessian(hinge_bending(world.hinges), x)
    viscosity = dt * dense_hessian(damping(world, rate=0, stiffness=beta).begin(step_at(x, dt=dt)), x)
    assert np.abs(viscosity - beta * stiffness).max() < 1e-12 * np.abs(stiffness).max()


def test_strain_rate_of_a_stretched_square():
    """A square pulled at the rate e in one direction: the force per length is eta e."""
    world, dt, rate = two_triangles(), 0.01, 1e-6
    x = world.start()
    energy = damping(world, rate=0, strain_rate=0.7).begin(step_at(x, dt=dt))
    pulled = x * [1 + rate * dt, 1, 1]
    force = energy.gradient(pulled)[x[:, 0] > 0.5].sum(axis=0)
    assert force == pytest.approx([0.7 * rate, 0, 0], rel=1e-6, abs=1e-14)


@pytest.mark.parametrize(("keys", "beta"), [({"stiffness": 0.02}, 0.02), ({"rate": 0.3}, None)])
def test_an_oscillator_of_two_triangles_decays_at_its_closed_rate(keys, beta):
    """exp(-beta w^2 t / 2) for the stiffness, exp(-rate t / 2) for the mass; BDF2 with 160 steps a period."""
    world = two_triangles()
    x, masses = world.start(), np.repeat(world.masses, 3)
    squares, modes = scipy.linalg.eigh(dense_hessian(membrane(world), x), np.diag(masses))
    mode, w = modes[:, -1].reshape(-1, 3), np.sqrt(squares[-1])
    assert squares[-1] > 1.2 * squares[-2]
    period = 2 * np.pi / w
    start = make_world([replace(world.cloths[0], positions=x + 1e-5 * mode)])
    energies = {"inertia": inertia(world), "membrane": membrane(world), "damping": damping(world, **{"rate": 0} | keys)}
    integrator = replace(integrator_of(start, energies, period / 160, tolerance=1e-11), formula="bdf2")
    reports = run_of(integrator, 2 * period, 160 / period)
    swing = np.array([masses @ ((r.state.positions - x) * mode).ravel() for r in reports]) / 1e-5
    rate = w**2 * beta / 2 if beta else keys["rate"] / 2
    times, damped = np.array([r.state.time for r in reports]), np.sqrt(w**2 - rate**2)
    exact = np.exp(-rate * times) * (np.cos(damped * times) + rate / damped * np.sin(damped * times))
    assert 0.2 < np.exp(-rate * 2 * period) < 0.9
    assert np.abs(swing - exact).max() < 0.015


def test_a_rate_may_vary_over_the_cloth():
    world = small_world()
    x = world.start()
    left = x[world.triangles].mean(axis=1)[:, 0] < 0.5
    energy = damping(world, rate=np.where(left, 2.0, 0.0)).begin(step_at(x, dt=0.1))
    force = energy.gradient(x + 0.1).sum(axis=0)
    assert force == pytest.approx(np.full(3, 2.0 * UNIT.density * world.rest_areas[left].sum()))
    assert np.array_equal(
        damping(world, rate=np.full(len(left), 2.0)).begin(step_at(x, dt=0.1)).gradient(x + 0.1),
        damping(world, rate=2.0).begin(step_at(x, dt=0.1)).gradient(x + 0.1),
    )


def test_the_mass_term_by_the_start_of_a_step():
    """rate m v turned by the adjoint a: -rate m a / h, with h and x_n of the difference formula."""
    world, rng = small_world(), np.random.default_rng(4)
    x, a, moved = rng.standard_normal((3, *world.start().shape))
    step = bdf2_step(turned(x, -25), x, 0.07, 0.1)
    energy = damping(world, rate=2.0).begin(step)
    found = energy.past_sensitivity(step, x, a).past_positions
    assert found == pytest.approx(-2.0 * world.masses[:, None] * a / step.past.dt, rel=1e-12)
    changed = replace(energy, start=energy.start + moved).gradient(x) - energy.gradient(x)
    assert np.vdot(found, moved) == pytest.approx(np.vdot(a, changed), rel=1e-9)


def test_only_what_is_asked_for_is_there():
    world = small_world()
    assert isinstance(damping(world), MassDamping)
    assert isinstance(damping(world, rate=0), Off)
    soft = small_world(fabric=replace(UNIT, youngs_modulus=0.0, bending_stiffness=0.0))
    assert "no stiffness" in damping(soft, rate=0, stiffness=1.0).reason
    for key in ("rate", "stiffness", "strain_rate"):
        with pytest.raises(InputError, match=f"effects.damping.{key} must be at least 0"):
            damping(world, **{key: -1.0})
