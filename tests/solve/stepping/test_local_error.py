"""Local error of a step: closed forms, order, prescribed rows."""

from dataclasses import replace

import numpy as np
import pytest
from effect_builders import gravity, inertia, membrane, pins
from meshes import cloth, irregular_grid, small_world
from solving import integrator_of, run_of

from clothsim.mesh.world import make_world
from clothsim.physics.energies.step import Past
from clothsim.solve.stepping.integrators import Formula
from clothsim.solve.stepping.local_error import STARTUP_FACTOR, VELOCITY_ERROR_FACTOR, step_error
from clothsim.solve.stepping.state import Previous, State

NOBODY = np.zeros(0, np.int64)
PAST = Past(np.zeros((2, 3)), np.zeros((2, 3)), 1.0)


@pytest.mark.parametrize("formula", ["backward_euler", "bdf2"])
def test_free_fall_tells_its_exact_error(formula):
    """Backward Euler: g T dt/2; BDF2: 3/4 g dt^2 of its first step, and nothing more; times SWING."""
    world, dt, T = small_world(), 0.02, 0.4
    energies = {"inertia": inertia(world), "gravity": gravity(world)}
    reports = run_of(replace(integrator_of(world, energies, dt, tolerance=1e-9), formula=formula), T)
    end = reports[-1].state
    error = np.abs(end.positions - world.start() + [0, 0, 9.81 * T**2 / 2]).max()
    assert error > 1e-3
    assert end.temporal_error == pytest.approx(VELOCITY_ERROR_FACTOR * error, rel=1e-6)
    assert sum(report.error.largest for report in reports) == pytest.approx(end.temporal_error)


@pytest.mark.parametrize("ratio", [0.5, 1.0, 2.0])
def test_bdf2_takes_the_third_derivative(ratio):
    """With v = 3 c t^2, h (v(n+1) - v*) / 3 = c h^2 (h + h/r): the truncation of x = c t^3, h^3 x'''/3 where r = 1."""
    h, c = 0.1, 1.7
    k = h / ratio

    def speed(t):
        return np.array([[3 * c * t**2, 0.0, 0.0]])

    before = State(1.0, h, 1, 0, 0 * speed(0), speed(1.0), previous=Previous(0 * speed(0), speed(1.0 - k), k))
    reported = step_error("bdf2", Formula(PAST, 2, ratio), before, speed(1.0 + h), h, NOBODY)
    assert reported.rms == reported.largest == pytest.approx(VELOCITY_ERROR_FACTOR * c * h**2 * (h + k), rel=1e-9)


def test_rms_and_largest_over_the_vertices_but_for_those_that_are_held():
    before = State(0.0, 0.1, 0, 0, np.zeros((3, 3)), np.zeros((3, 3)))
    after = np.array([[3.0, 0, 0], [0, 4.0, 0], [100.0, 0, 0]])
    reported = step_error("backward_euler", Formula(PAST, 1), before, after, 0.1, np.array([2]))
    assert reported.largest == pytest.approx(VELOCITY_ERROR_FACTOR * 0.05 * 4)
    assert reported.rms == pytest.approx(VELOCITY_ERROR_FACTOR * 0.05 * np.sqrt((9 + 16) / 3))
    begun = step_error("bdf2", Formula(PAST, 1), before, after, 0.1, np.array([2]))
    assert begun.rms == pytest.approx(STARTUP_FACTOR * reported.rms)


def test_a_quasi_static_step_has_none():
    world, held = pins(make_world([cloth(*irregular_grid())]), select="left")
    energies = {"membrane": membrane(world), "gravity": gravity(world, acceleration=(0.1, 0.0, 0.0))}
    reports = run_of(integrator_of(world, energies, 0.5, {"pins": held}, ramp=1.0), 1.0)
    assert [report.error for report in reports] == [None, None]
    assert reports[-1].state.temporal_error == 0.0
