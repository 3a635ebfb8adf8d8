"""Time steps: retries with half the dt, growth, frames on their times, the ramp of a quasi-static run."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from effect_builders import gravity, inertia, membrane, pins
from hurdle import Hurdle
from meshes import cloth, grid, small_world
from solving import integrator_of, run_of

from clothsim import Scene, simulate
from clothsim.mesh.world import make_world
from clothsim.physics.energies.base import Prescribed
from clothsim.solve.newton import newton
from clothsim.solve.newton.outcome import Ending
from clothsim.solve.newton.potential import Potential
from clothsim.solve.stepping.state import first_state
from clothsim.solve.stepping.stepping import GROWTH, MAX_HALVINGS, MOST_SUNK, _added, _blocked, _shorter, advance
from clothsim.solve.stepping.time_loop import steps


def falling(*hurdles, dt=0.1):
    world = small_world()
    energies = {"inertia": inertia(world), "gravity": gravity(world)}
    return integrator_of(world, energies | {f"hurdle {k}": h for k, h in enumerate(hurdles)}, dt, tolerance=1e-9)


def test_a_failed_step_is_tried_again_with_half_the_dt():
    integrator = falling(Hurdle(longest=0.03))
    report = advance(integrator, first_state(integrator.world, 0.1), until=1.0)
    assert report.converged
    assert report.dt == 0.025
    assert len(report.failures) == 2
    assert all("not finite" in failure for failure in report.failures)
    assert report.state.time == report.dt
    fallen = report.state.positions - integrator.world.start()
    assert np.abs(fallen - [0, 0, -9.81 * 0.025**2]).max() < 1e-12


def test_a_retry_is_a_step_from_the_same_state():
    """The bits are those of a step that took the short dt at once."""
    failing, free = falling(Hurdle(longest=0.03)), falling()
    retried = advance(failing, first_state(failing.world, 0.1), until=1.0)
    direct = advance(free, first_state(free.world, 0.025), until=1.0)
    assert np.array_equal(retried.state.positions, direct.state.positions)
    assert np.array_equal(retried.state.velocities, direct.state.velocities)


def test_dt_grows_back_by_a_twentieth_a_step_and_never_above_its_bound():
    integrator = falling(Hurdle(longest=0.03, until=0.01))
    reports = run_of(integrator, 3.0)
    sizes = np.array([report.dt for report in reports])
    wanted = 0.025 * GROWTH ** np.arange(len(sizes))
    assert sizes[0] == pytest.approx(0.025, rel=1e-2)
    assert (sizes <= np.minimum(wanted, 0.1) * (1 + 1e-9)).all()
    assert sizes[5] > 1.2 * sizes[0]
    assert sizes.max() == pytest.approx(0.1, rel=0.05)
    assert [len(report.failures) for report in reports[1:]] == [0] * (len(reports) - 1)


def test_what_never_converges_is_given_up_after_a_bounded_number_of_halvings():
    integrator = falling(Hurdle(longest=0.0))
    start = first_state(integrator.world, 0.1)
    reports = list(steps(integrator, start, 1.0, 10))
    assert len(reports) == 1
    assert not reports[0].converged
    assert reports[0].state is start
    assert len(reports[0].failures) == MAX_HALVINGS + 1
    assert reports[0].result.outcome.ending is Ending.NOT_FINITE
    assert reports[0].dt == pytest.approx(0.1 / 2**MAX_HALVINGS)


@pytest.mark.parametrize(
    ("dt", "duration", "fps"), [(0.1, 1.0, 3), (0.03, 0.5, 25), (0.02, 0.33, 7), (1.0, 0.5, 10), (0.01, 0.1, 1)]
)
def test_frames_land_on_their_times(dt, duration, fps):
    reports = run_of(falling(dt=dt), duration, fps)
    times = [report.state.time for report in reports if report.frame_done]
    count = max(1, int(np.ceil(duration * fps - 1e-9)))
    assert times == [min((k + 1) / fps, duration) for k in range(count)]
    assert [report.state.frame for report in reports if report.frame_done] == list(range(1, count + 1))
    assert [report.state.step for report in reports] == list(range(1, len(reports) + 1))
    assert max(report.dt for report in reports) <= dt * (1 + 1e-9)
    assert min(report.dt for report in reports) > 0.3 * min(dt, 1 / fps, duration)


def test_a_step_that_sinks_is_repeated_and_the_last_solve_is_not_probed(monkeypatch):
    integrator = falling()
    start = first_state(integrator.world, 0.1)
    alone = advance(integrator, start, until=1.0)
    begun, begin = [], Potential.begin
    monkeypatch.setattr(Potential, "begin", lambda self, step: (begun.append(step), begin(self, step))[1])
    monkeypatch.setattr(Potential, "stiffnesses_needed", lambda self, start, x: {"toy": float(len(begun))})
    monkeypatch.setattr(newton, "PROBE_PERIOD", 1)
    report = advance(integrator, start, until=1.0)
    assert report.converged
    assert report.failures == alone.failures == ()
    assert [step.least_stiffness.get("toy") for step in begun] == [None, *map(float, range(1, MOST_SUNK + 1))]
    assert report.result.iterations == alone.result.iterations + MOST_SUNK
    assert np.array_equal(report.state.positions, alone.state.positions)


def test_a_repeated_solve_counts_the_iterations_before_it():
    result = advance(falling(), first_state(small_world(), 0.1), until=1.0).result
    before = replace(result, iterations=50, elimination_iterations=70)
    both = _added(before, replace(result, iterations=3, elimination_iterations=4))
    assert (both.iterations, both.elimination_iterations) == (53, 74)


def test_frames_land_on_their_times_after_failures_too():
    reports = run_of(falling(Hurdle(longest=0.013, since=0.1, until=0.4)), 1.0, 4)
    assert [report.state.time for report in reports if report.frame_done] == [0.25, 0.5, 0.75, 1.0]
    assert sum(len(report.failures) for report in reports) > 0


def test_velocities_are_those_of_the_step():
    integrator = falling()
    start = first_state(integrator.world, 0.1)
    one = advance(integrator, start, until=1.0)
    two = advance(integrator, one.state, until=1.0)
    difference = (two.state.positions - one.state.positions) / two.dt
    assert np.array_equal(two.state.velocities, difference)
    assert two.fastest == pytest.approx(2 * 9.81 * 0.1)


def test_loads_of_a_quasi_static_run_grow_along_its_ramp():
    positions, triangles = grid(1, 3, 0.3, 1.0)
    world, constraint = pins(make_world([cloth(positions, triangles)]), select="top")
    energies = {"membrane": membrane(world), "gravity": gravity(world, acceleration=(0.0, -0.4, 0.0))}
    integrator = integrator_of(world, energies, 0.25, {"pins": constraint}, ramp=0.5, tolerance=1e-9)
    held = constraint.at(0.0).vertices
    hanging = world.masses.sum() - world.masses[held].sum()
    loads = []
    for report in run_of(integrator, 1.0):
        force = energies["membrane"].gradient(report.state.positions)[held, 1].sum()
        loads.append(force / (0.4 * hanging))
    assert loads == pytest.approx([0.5, 1.0, 1.0, 1.0], abs=1e-7)


def test_without_a_ramp_loads_act_at_once():
    positions, triangles = grid(1, 3, 0.3, 1.0)
    world, constraint = pins(make_world([cloth(positions, triangles)]), select="top")
    energies = {"membrane": membrane(world), "gravity": gravity(world, acceleration=(0.0, -0.4, 0.0))}
    reports = run_of(integrator_of(world, energies, 0.5, {"pins": constraint}, tolerance=1e-9), 1.0)
    assert np.abs(reports[0].state.positions - reports[1].state.positions).max() < 1e-8
    assert np.abs(reports[0].state.positions - world.start()).max() > 0.01


def test_a_sheet_hinged_at_an_edge_swings_down_under_any_load():
    """The first load is .02 of its weight; a smaller one needs more iterations, so that half a step is no remedy."""
    effects = {"membrane": {}, "bending": {}, "gravity": {}, "pins": {"select": "left"}}
    sheet = {"mesh": "rectangle", "size": [0.3, 0.3], "cells": [4, 4], "fabric": "cotton"}
    solver = {"dt": 0.01, "threads": 1, "linear": "superlu", "max_iterations": 20}
    run = {"duration": 1.0, "frames_per_second": 50, "until": "rest"}
    result = simulate(Scene(cloth=sheet, effects=effects, solver=solver, run=run))
    assert result.summary["status"] == "completed", result.summary["reason"]
    assert result.record()[0]["newton_iterations"] > 20
    assert result.record()[0]["failures"] == []
    assert result.positions(-1)[:, 2].min() == pytest.approx(-0.3, rel=0.01)


def test_blocked_tries_count_while_the_obstacle_stays_where_it_was():
    """The time of the block is that of the part of the prescribed path that was covered; an earlier one is ignored."""
    state = replace(first_state(small_world(), 0.1), time=1.0)
    target = Prescribed(np.array([0]), state.positions[:1] + np.array([0.0, 0.0, 2.0]))

    def tried(state, covered):
        x = state.positions.copy()
        x[0, 2] += 2.0 * covered
        return _blocked(state, SimpleNamespace(x=x), target, 0.1)

    first = tried(state, 0.7)
    assert (first.blocked_at, first.blocked) == (pytest.approx(1.07), 1)
    assert tried(first, 0.7).blocked == 2
    assert tried(first, 0.5) is first
    assert tried(first, 0.6) is first
    further = tried(first, 0.9)
    assert (further.blocked_at, further.blocked) == (pytest.approx(1.09), 1)


@pytest.mark.parametrize(("h", "wanted"), [(0.04, 0.02), (0.011, 0.01), (0.01, 0.01)])
def test_a_step_with_too_large_an_error_is_tried_again_down_to_the_shortest(h, wanted):
    control = SimpleNamespace(exceeds=lambda *_: True, shortest=0.01, retry=lambda state, h, error: max(0.01, h / 2))
    error = SimpleNamespace(rms=1.0)
    assert _shorter(SimpleNamespace(control=control), None, h, error) == pytest.approx(wanted)
    control.exceeds = lambda *_: False
    assert _shorter(SimpleNamespace(control=control), None, h, error) == np.inf
    assert _shorter(SimpleNamespace(control=None), None, h, error) == np.inf
