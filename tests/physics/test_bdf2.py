"""BDF2 with variable steps: free fall, orders, the pendulum, damping, pins (docs/theory.md#time-integration)."""

from dataclasses import replace

import numpy as np
import pytest
from meshes import cloth, irregular_grid
from scipy.special import ellipk
from solving import integrator_of, run_of

from clothsim.mesh.world import make_world
from clothsim.solve.stepping import integrators as formulas
from clothsim.solve.stepping.state import Previous, first_state
from clothsim.solve.stepping.stepping import advance
from tests.known_answers.a4_time import GRAVITY as G
from tests.known_answers.a4_time import falling, ringing, swing_ratio
from tests.support.effect_builders import damping, inertia, membrane, pins


def bdf2(*arguments, **keywords):
    return replace(integrator_of(*arguments, **keywords), formula="bdf2")


def fall(dt):
    return falling("bdf2", dt)


@pytest.mark.parametrize("dt", [0.1, 0.02])
def test_free_fall_keeps_the_error_of_its_first_step(dt):
    """That of backward Euler, g dt^2/2, which the second root 1/3 carries on to 3/4 g dt^2; nothing else is wrong."""
    integrator = fall(dt)
    reports = run_of(integrator, 0.4)
    for n, report in enumerate(reports, start=1):
        t = n * dt
        fallen = report.state.positions - integrator.world.start()
        late = 0.75 * dt**2 * (1 - 3.0**-n)
        assert np.abs(fallen - G * (t**2 / 2 + late)).max() < 1e-11
        assert np.abs(report.state.velocities - G * t).max() < 1e-10


def test_free_fall_is_exact_from_an_exact_past_whatever_the_steps():
    integrator = fall(0.1)
    start = integrator.world.start()

    def place(t):
        return start + G * t**2 / 2

    h = 0.05
    state = replace(first_state(integrator.world, h), time=h, positions=place(h), velocities=0 * start + G * h)
    state = replace(state, previous=Previous(start, 0 * start, h))
    for h in (0.05, 0.1, 0.03, 0.06, 0.02, 0.04):
        state = advance(integrator, replace(state, dt=h), until=state.time + h).state
        assert np.abs(state.positions - place(state.time)).max() < 1e-12
        assert np.abs(state.velocities - G * state.time).max() < 1e-11


# --- orders ---------------------------------------------------------------------------------------------------------


def errors(pattern, counts):
    """Largest errors at .8 s of BDF2 with so many rounds of steps in the proportions of `pattern`."""
    world, energies, exact = ringing()
    found = []
    for count in counts:
        unit = 0.8 / (count * sum(pattern))
        integrator = bdf2(world, energies, unit * max(pattern), tolerance=1e-9)
        state = first_state(world, unit)
        for fraction in pattern * count:
            state = advance(integrator, replace(state, dt=fraction * unit), until=state.time + fraction * unit).state
        found.append(np.abs(state.positions - exact).max())
    return np.array(found)


def orders(found):
    return np.log2(found[:-1] / found[1:])


def test_equal_steps_are_of_second_order():
    found = errors([1], (40, 80))
    assert orders(found)[-1] >= 1.85
    assert found[-1] < 1e-2


def test_varying_steps_are_of_second_order():
    found = errors([1, 2, 1, 0.5], (20, 40))
    assert orders(found)[-1] >= 1.85


def test_the_constant_form_would_be_of_first_order_on_varying_steps(monkeypatch):
    """Purpose of the formula with r (docs/theory.md#time-integration: 1.04 against 1.98)."""
    right = formulas.bdf2_past
    monkeypatch.setattr(formulas, "bdf2_past", lambda state, before, h, r: right(state, before, h, 1.0))
    found = errors([1, 2, 1, 0.5], (20, 40))
    assert orders(found)[-1] < 1.3


# --- the pendulum ---------------------------------------------------------------------------------------------------


def test_the_period_of_a_pendulum_at_sixty_degrees():
    """T/T0 = 2 K(sin^2(30 deg))/pi = 1.0731820071; BDF2 is late by a fraction (w dt)^2/3, which two dt take out."""
    exact = 2 * ellipk(np.sin(np.radians(30)) ** 2) / np.pi
    assert exact == pytest.approx(1.0731820071, abs=1e-10)
    ratios = [swing_ratio(count) for count in (100, 200)]
    assert abs(ratios[1] - exact) < 1e-3
    assert (4 * ratios[1] - ratios[0]) / 3 == pytest.approx(exact, rel=1e-4)


# --- what else takes velocities -------------------------------------------------------------------------------------


def test_damping_takes_its_velocity_from_the_same_formula():
    """A sheet that drifts slows down as e^(-rate t), to second order."""
    world = make_world([cloth(*irregular_grid(), velocity=(1.0, 2.0, 3.0))])
    energies = {"inertia": inertia(world), "damping": damping(world, rate=3.0)}
    found = []
    for dt in (0.02, 0.01, 0.005):
        end = run_of(bdf2(world, energies, dt, tolerance=1e-10), 0.4)[-1].state
        found.append(np.abs(end.velocities - world.start_velocities() * np.exp(-1.2)).max())
    assert orders(np.array(found))[-1] >= 1.85


def test_pins_have_the_velocity_of_their_script():
    """From the second step on: the formula differentiates a straight way exactly."""
    world = make_world([cloth(*irregular_grid())])
    world, held = pins(world, select="left", motion={"velocity": [0.0, 0.3, 1.0]})
    rows = held.at(0.0).vertices
    energies = {"inertia": inertia(world), "membrane": membrane(world)}
    for report in run_of(bdf2(world, energies, 0.02, {"pins": held}), 0.1):
        assert np.abs(report.state.velocities[rows] - [0.0, 0.3, 1.0]).max() < 1e-12


def test_rigid_translation_stays_exact():
    world = make_world([cloth(*irregular_grid(), velocity=(3.0, -2.0, 1.0))])
    end = run_of(bdf2(world, {"inertia": inertia(world), "membrane": membrane(world)}, 0.05), 0.4)[-1].state
    assert np.abs(end.positions - world.start() - [1.2, -0.8, 0.4]).max() < 1e-12
