"""Local error of a step: closed forms, order, prescribed rows."""

from dataclasses import replace

import numpy as np
import pytest
from effect_builders import body_contact, gravity, inertia, membrane, pins
from hurdle import Hurdle
from meshes import cloth, grid, irregular_grid, small_world
from small_scenes import small_scene
from solving import integrator_of, run_of

from clothsim import simulate
from clothsim.mesh.body import make_body
from clothsim.mesh.world import make_world
from clothsim.physics.energies.base import Past
from clothsim.solve.stepping.integrators import LARGEST_RATIO, Formula
from clothsim.solve.stepping.local_error import (
    LARGEST_FACTOR,
    LARGEST_RETRY,
    LEAST_FRACTION,
    MOST_STEPS,
    SMALLEST_FACTOR,
    STARTUP_FACTOR,
    VELOCITY_ERROR_FACTOR,
    ErrorControl,
    step_error,
)
from clothsim.solve.stepping.state import Previous, State, first_state
from clothsim.solve.stepping.stepping import GROWTH, advance
from clothsim.solve.stepping.time_loop import steps

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


PAPER = {"density": 0.12, "thickness": 2e-4, "youngs_modulus": 2e6, "poisson_ratio": 0.3, "bending_stiffness": 2e-4}
ELASTIC = {"inertia": {}, "membrane": {}, "bending": {"model": "hinge"}, "gravity": {}}


def drape():
    """A sheet as stiff as paper that lies down over a ball, off its centre: one solution."""
    return {
        "cloth": {"mesh": "rectangle", "size": [0.24, 0.24], "cells": [6, 6], **PAPER},
        "body": {
            "name": "ball",
            "mesh": "sphere",
            "radius": 0.08,
            "position": [0.01, 0.02, -0.0825],
            "subdivisions": 2,
        },
        "effects": {**ELASTIC, "damping": {"rate": 4.0}, "body_contact": {"d_hat": 2e-3}},
        "run": {"duration": 0.12, "frames_per_second": 25},
    }


def ramp():
    """A card inside d_hat of a ramp, held by friction for the first steps of a solve."""
    start = {"rotation_degrees": [0, 25, 0], "position": [0.0046, 0.0, 0.0099]}
    return {
        "cloth": {"mesh": "rectangle", "size": [0.2, 0.1], "cells": [4, 2], **PAPER, **start},
        "body": {"name": "ramp", "mesh": "slab", "size": [1.0, 0.4, 0.02], "rotation_degrees": [0, 25, 0]},
        "effects": {**ELASTIC, "body_contact": {"d_hat": 2e-3}, "friction": {"coefficient": 0.2}},
        "run": {"duration": 0.12, "frames_per_second": 25},
    }


def end_of(sections, folder, **solver):
    given = {"dt": 0.01, "threads": 1, "linear": "superlu", "integrator": "backward_euler", **solver}
    run = simulate(small_scene(**sections, solver=given), folder)
    assert run.status == "completed"
    return run.positions(-1), run.summary["newton_iterations"]


def distance(one, other):
    return float(np.sqrt(((one - other) ** 2).sum(axis=1).mean()))


@pytest.mark.parametrize(("stop", "most_of_dt"), [({}, 0.2), ({"converge": True}, 0.1)])
@pytest.mark.parametrize("sections", [drape, ramp])
def test_the_accumulated_error_stays_well_below_that_of_dt(tmp_path, sections, stop, most_of_dt):
    tight, most = end_of(sections(), tmp_path / "tight", tolerance=1e-6)
    half, _ = end_of(sections(), tmp_path / "half", tolerance=1e-5, dt=0.005)
    balanced, iterations = end_of(sections(), tmp_path / "balanced", **stop)
    assert iterations < 0.9 * most
    assert distance(half, tight) > 1e-5
    assert distance(balanced, tight) < most_of_dt * distance(half, tight)


def test_a_scene_of_ten_times_the_size_takes_the_same_iterations(tmp_path):
    """Lengths by 10, times and speeds by 10^1/2, stiffness as weight over length asks: no constant has a unit."""
    sections, factor = drape(), 10.0
    duration = factor**0.5
    cloth, body = dict(sections["cloth"]), dict(sections["body"])
    cloth |= {"size": [2.4, 2.4], "thickness": 2e-3, "bending_stiffness": 0.2}
    body |= {"radius": 0.8, "position": [0.1, 0.2, -0.825]}
    effects = sections["effects"] | {"damping": {"rate": 4.0 / duration}, "body_contact": {"d_hat": 2e-2}}
    run = {"duration": 0.12 * duration, "frames_per_second": 25 / duration}
    large = {"cloth": cloth, "body": body, "effects": effects, "run": run}
    one, few = end_of(sections, tmp_path / "small")
    other, many = end_of(large, tmp_path / "large", dt=0.01 * duration)
    assert few == many
    assert np.abs(other / factor - one).max() < 1e-6


CONTROL = ErrorControl(1e-3, 2.0, 0.04)
START = first_state(small_world(), 0.01)


def test_a_step_may_add_its_fraction_of_the_time_but_at_least_a_fraction_of_the_error():
    assert not CONTROL.exceeds(START, 0.01, 0.99 * LEAST_FRACTION * 1e-3)
    assert CONTROL.exceeds(START, 0.01, 1.01 * LEAST_FRACTION * 1e-3)
    assert not CONTROL.exceeds(START, 1.0, 0.49e-3)
    spent = replace(START, temporal_error=0.9e-3)
    assert CONTROL.exceeds(spent, 0.01, 1.01 * LEAST_FRACTION * 1e-4)


@pytest.mark.parametrize("order", [1, 2])
def test_the_next_dt_would_have_added_its_fraction(order):
    """The error of a step is ~ h^(order+1): with the chosen dt it is SAFETY^.. of what is left for it."""
    h, rate = 0.01, 1e-3 / 2.0
    for fraction in (0.7, 1.0, 1.5):
        chosen = CONTROL.next_dt(START, h, fraction * rate * h, order)
        added = fraction * rate * h * (chosen / h) ** (order + 1)
        assert added / (rate * chosen) == pytest.approx(0.9)


def test_factors_have_their_bounds():
    for order, largest in LARGEST_FACTOR.items():
        assert CONTROL.next_dt(START, 0.01, 1e-12, order) == pytest.approx(0.01 * largest)
        assert CONTROL.next_dt(START, 0.01, 0.0, order) == pytest.approx(0.01 * largest)
        assert CONTROL.next_dt(START, 0.01, 1.0, order) == pytest.approx(0.01 * SMALLEST_FACTOR)
    assert CONTROL.next_dt(START, 0.03, 0.0, 1) == 0.04
    assert LARGEST_FACTOR[2] < LARGEST_RATIO
    assert CONTROL.retry(START, 0.01, 1.0) == pytest.approx(0.01 * SMALLEST_FACTOR)
    assert CONTROL.retry(START, 0.01, 1.01 * LEAST_FRACTION * 1e-3) == pytest.approx(0.01 * LARGEST_RETRY)


def test_there_is_a_floor():
    assert CONTROL.shortest == 2.0 / MOST_STEPS
    assert CONTROL.retry(START, 1.5 * CONTROL.shortest, 1.0) == CONTROL.shortest
    assert CONTROL.next_dt(START, CONTROL.shortest, 1.0, 1) == CONTROL.shortest


# --- in steps -------------------------------------------------------------------------------------------------------


def falling(error, *hurdles, formula="backward_euler", longest=0.1, duration=1.0):
    world = small_world()
    energies = {"inertia": inertia(world), "gravity": gravity(world)}
    energies |= {f"hurdle {k}": h for k, h in enumerate(hurdles)}
    integrator = integrator_of(world, energies, longest, tolerance=1e-9)
    return replace(integrator, formula=formula, control=ErrorControl(error, duration, longest))


def run(integrator, fps=5):
    reports = list(steps(integrator, first_state(integrator.world, integrator.dt), 1.0, fps))
    assert all(report.converged for report in reports), reports[-1].failures
    return reports


@pytest.mark.parametrize("formula", ["backward_euler", "bdf2"])
def test_frames_land_on_their_times_and_what_was_asked_for_is_not_spent_twice(formula):
    reports = run(falling(0.05, formula=formula), fps=7)
    assert [report.state.time for report in reports if report.frame_done] == [min((k + 1) / 7, 1.0) for k in range(7)]
    assert reports[0].rejected > 0
    spent = [report.state.temporal_error for report in reports]
    assert (np.diff(spent) >= 0).all()
    assert spent[-1] <= 0.05
    sizes = np.array([report.dt for report in reports])
    assert (sizes <= 0.1 * (1 + 1e-9)).all()
    ratios = sizes[1:] / sizes[:-1]
    assert ratios.max() <= LARGEST_FACTOR[1 if formula == "backward_euler" else 2] * (1 + 1e-9)


def test_free_fall_of_backward_euler_needs_the_steps_of_its_closed_form():
    """Its error is g T h / 2, and the estimate twice that: T / h = g T^2 / error steps."""
    for error in (0.2, 0.1):
        count = len(run(falling(error)))
        assert count == pytest.approx(9.81 / error, rel=0.3)


def test_bdf2_falls_in_as_few_steps_as_frames_let_it_once_it_has_begun():
    """It has no error there but that of its first step."""
    reports = run(falling(0.01, formula="bdf2", longest=0.2))
    assert reports[-1].dt > 0.09
    assert len(reports) < 20


def test_a_failed_solve_is_tried_with_half_the_dt_and_grows_back_from_the_next_step_on():
    integrator = falling(10.0, Hurdle(longest=0.03, until=0.05))
    report = advance(integrator, first_state(integrator.world, 0.1), until=1.0)
    assert report.converged
    assert len(report.failures) == 2
    assert report.state.dt == pytest.approx(0.025)
    after = advance(replace(integrator, control=None), report.state, until=1.0)
    assert after.failures == ()
    assert after.state.dt == pytest.approx(GROWTH * 0.025, rel=0.03)


def test_what_never_converges_ends_here_too():
    integrator = falling(0.01, Hurdle(longest=0.0))
    report = advance(integrator, first_state(integrator.world, 0.1), until=1.0)
    assert not report.converged
    assert 5 < len(report.failures) < 20


def test_contact_is_as_stiff_in_short_steps_as_in_long_ones():
    """Else a barrier that stiffens as dt shrinks would throw what touches."""
    positions, triangles = grid(2, 2)
    sheet = replace(
        cloth(positions, triangles, velocity=(0, 0, -0.1)), positions=positions + np.array([0.1, 0.2, 0.01])
    )
    plate = np.array([[-5.0, -4, 0], [5, -5, 0], [4.5, 5, 0], [-5, 5, 0]]), np.array([[0, 1, 2], [0, 2, 3]])
    world = make_world([sheet], [make_body("plate", *plate)])
    energies = {"inertia": inertia(world), "membrane": membrane(world), "gravity": gravity(world)}
    energies["body_contact"] = body_contact(world, d_hat=0.02)
    integrator = replace(integrator_of(world, energies, 0.01), control=ErrorControl(1.0, 1.0, 0.01))
    found = [
        advance(integrator, first_state(world, dt), until=dt).state.memory["body_contact"] for dt in (1e-2, 1e-3, 1e-5)
    ]
    assert found == pytest.approx([found[0]] * 3, rel=1e-9)


def test_at_the_floor_steps_are_taken_and_reported():
    """Asked for a nanometre, backward Euler would fall in ten thousand million steps."""
    integrator = falling(1e-9)
    state = first_state(integrator.world, 0.1)
    report = advance(integrator, state, until=1.0)
    assert report.converged
    assert report.at_floor
    assert report.dt == pytest.approx(1.0 / MOST_STEPS)
