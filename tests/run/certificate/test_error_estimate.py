"""Error estimate of the certificate: sums over the steps, and "not estimated" where there is none."""

from dataclasses import replace

import numpy as np
import pytest
from effect_builders import body_contact, gravity, inertia, membrane, pins
from meshes import cloth, grid, irregular_grid
from solving import integrator_of, run_of

from clothsim.mesh.body import make_body
from clothsim.mesh.world import make_world
from clothsim.run.certificate.error_estimate import ErrorEstimate

PLATE = np.array([[-5.0, -4, 0], [5, -5, 0], [4.5, 5, 0], [-5, 5, 0]]), np.array([[0, 1, 2], [0, 2, 3]])


def estimated(reports):
    estimate = ErrorEstimate()
    for report in reports:
        estimate = estimate.after(report)
    return estimate


def flight(tolerance):
    rest, triangles = irregular_grid()
    world = make_world([replace(cloth(rest, triangles), positions=rest * [1.2, 0.9, 1.0])])
    energies = {"inertia": inertia(world), "membrane": membrane(world)}
    return run_of(integrator_of(world, energies, 0.05, tolerance=tolerance), 0.5)


def test_the_temporal_error_is_summed_over_the_steps():
    reports = flight(1e-6)
    reported = estimated(reports).as_dict()
    assert reported["temporal"] == pytest.approx(sum(report.error.rms for report in reports))
    assert reported["temporal_largest"] == pytest.approx(sum(report.error.largest for report in reports))
    assert reported["temporal_largest"] > reported["temporal"] > 1e-3
    assert reported["contact_gap"] == "not estimated (no contact)"
    assert "asked" not in reported


@pytest.mark.parametrize("tolerance", [1e-1, 1e-2])
def test_newton_s_part_tells_the_size_of_what_it_left(tolerance):
    """Against the same run solved to the end: not less than what is seen, and not a hundred times more."""
    coarse, exact = flight(tolerance), flight(1e-10)
    seen = np.abs(coarse[-1].state.positions - exact[-1].state.positions).max()
    reported = estimated(coarse).newton
    assert seen > 1e-8
    assert 0.3 * seen < reported < 100 * seen
    assert estimated(exact).newton < 1e-9


def test_contact_stands_off_by_the_fraction_of_d_hat_that_the_last_step_left():
    positions, triangles = grid(2, 2)
    sheet = replace(cloth(positions, triangles), positions=positions + np.array([0.1, 0.2, 0.012]))
    world = make_world([sheet], [make_body("plate", *PLATE)])
    energies = {"inertia": inertia(world), "membrane": membrane(world), "gravity": gravity(world)}
    energies["body_contact"] = body_contact(world, d_hat=0.02)
    reports = run_of(integrator_of(world, energies, 0.01), 0.1)
    height = reports[-1].state.positions[: world.n_cloth, 2].min()
    assert estimated(reports).contact_gap == pytest.approx(height / 0.02)


def test_a_quasi_static_run_has_no_error_of_time():
    world, held = pins(make_world([cloth(*irregular_grid())]), select="left")
    energies = {"membrane": membrane(world), "gravity": gravity(world, acceleration=(0.1, 0.0, 0.0))}
    reports = run_of(integrator_of(world, energies, 0.5, {"pins": held}, ramp=1.0), 1.0)
    reported = estimated(reports).as_dict()
    assert reported["temporal"] == reported["temporal_largest"] == "not estimated (quasi-static)"
    assert reported["newton"] == reports[-1].result.remaining


def test_what_was_asked_for_is_reported_with_whether_it_was_met():
    held, missed = ErrorEstimate(temporal=0.9e-3, steps=9), ErrorEstimate(temporal=3e-3, at_floor=7, steps=9)
    assert held.as_dict(1e-3) | {"asked": 1e-3, "met": True} == held.as_dict(1e-3)
    assert missed.as_dict(1e-3)["met"] is False
    assert held.unmet(1e-3) == ""
    assert "7 steps" in missed.unmet(1e-3)


def test_more_than_was_asked_for_is_missed_however_long_the_steps_were():
    long = ErrorEstimate(temporal=3e-3, steps=9)
    assert long.as_dict(1e-3)["met"] is False
    assert long.unmet(0.0) == ""
    assert all(f"{number:g} m" in long.unmet(1e-3) for number in (1e-3, 3e-3))


def test_of_no_step_nothing_is_estimated_and_nothing_met():
    reported = ErrorEstimate().as_dict(1e-3)
    assert reported.pop("asked") == 1e-3
    assert reported.pop("met") is False
    assert set(reported.values()) == {"not estimated (no step)"}


def test_a_run_that_was_not_completed_has_not_met_what_was_asked():
    held = ErrorEstimate(temporal=1e-4, temporal_largest=2e-4, steps=3)
    assert held.as_dict(1e-3)["met"] is True
    assert held.as_dict(1e-3, completed=False)["met"] is False
