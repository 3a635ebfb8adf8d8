"""Certificate of a run: energies, error estimate, changes of the stiffness."""

import json
from dataclasses import replace

import numpy as np
import pytest
from effect_builders import bending, body_contact, gravity, inertia, membrane, pins
from meshes import cloth, deformed, grid, irregular_grid, small_world
from solving import integrator_of, run_of

import clothsim
from clothsim.mesh.body import make_body
from clothsim.mesh.world import make_world
from clothsim.run.certificate import Certificate, ErrorEstimate, certificate_from
from clothsim.run.fields import world_stretches
from clothsim.run.intersections import IntersectionHistory, Occurrences
from clothsim.solve.stepping.state import first_state
from tests.hard_cases.rubbing import on_wall


def flight(*more):
    """Certificates after each step of a strained sheet, and the reports."""
    rest = small_world()
    sheet = replace(cloth(*irregular_grid()), positions=deformed(rest, amplitude=0.05))
    world = make_world([sheet])
    energies = {"inertia": inertia(world), "membrane": membrane(world), "bending": bending(world)}
    energies |= {name: build(world) for name, build in more}
    reports = run_of(integrator_of(world, energies, 0.05, tolerance=1e-8), 0.5)
    certificates, state = [Certificate()], first_state(world, 0.05)
    for report in reports:
        certificates.append(certificates[-1].after(world, report, state))
        state = report.state
    return world, reports, certificates[1:]


def test_stretches_are_the_extremes_over_all_steps():
    world, reports, certificates = flight()
    stretches = np.array([world_stretches(world, report.state.positions) for report in reports])
    assert certificates[-1].stretch_max == stretches[:, :, 0].max()
    assert certificates[-1].stretch_min == stretches[:, :, 1].min()
    assert certificates[-1].stretch_max > 1.01


def test_energy_is_kinetic_and_potential_and_does_not_rise_in_free_flight():
    world, reports, certificates = flight()
    state = reports[-1].state
    kinetic = 0.5 * world.masses @ (state.velocities**2).sum(axis=1)
    stored = membrane(world).value(state.positions) + bending(world).value(state.positions)
    assert certificates[-1].energy == pytest.approx(kinetic + stored, rel=1e-12)
    energies = [certificate.energy for certificate in certificates]
    assert (np.diff(energies) < 0).all()
    assert certificates[-1].energy_rise == 0
    assert certificates[-1].as_dict({})["energy_drift"] == 0


def test_a_fall_keeps_energy_but_for_the_integrator_s_loss():
    _, _, certificates = flight(("gravity", gravity))
    energies = [certificate.energy for certificate in certificates]
    assert (np.diff(energies) < 0).all()
    assert certificates[-1].energy_scale > abs(certificates[-1].energy)


def test_a_rise_is_reported():
    """The last step, had it begun at rest: it would have gained all its kinetic energy and what it stores more."""
    world, reports, _ = flight()
    report = reports[-1]
    before = replace(report.state, velocities=np.zeros_like(report.state.velocities))
    gained = 0.5 * world.masses @ (report.state.velocities**2).sum(axis=1)
    assert Certificate().after(world, report, before).energy_rise == pytest.approx(gained, rel=1e-9)


def test_a_step_never_ends_above_where_it_began():
    """Backward Euler's own law, |v1 - v0|^2_M/2 + Psi1 <= |v0|^2_M/2 + Psi0: E of the step, told by hand."""
    world, reports, certificates = flight()
    assert certificates[-1].step_rise == 0
    report, before = reports[-1], reports[-2].state
    turned = replace(report, state=before)
    change = report.state.velocities - before.velocities
    kinetic = 0.5 * world.masses @ (change**2 - before.velocities**2).sum(axis=1)
    stored = sum(
        energy(world).value(report.state.positions) - energy(world).value(before.positions)
        for energy in (membrane, bending)
    )
    backwards = Certificate().after(world, turned, report.state)
    assert kinetic + stored < 0
    assert backwards.step_rise == pytest.approx(-kinetic - stored, rel=1e-9)


def test_a_potential_made_stiffer_between_two_steps_is_no_rise():
    """As a barrier is: its stiffness is set anew at each step."""
    world, reports, certificates = flight()
    report = reports[-1]
    energies = report.potential.energies
    stiff = replace(energies["membrane"], mu=9 * energies["membrane"].mu, lam=9 * energies["membrane"].lam)
    stiffer = replace(report, potential=replace(report.potential, energies={**energies, "membrane": stiff}))
    after = certificates[-1].after(world, stiffer, report.state)
    assert after.energy > certificates[-1].energy
    assert after.energy_rise == 0


def test_gap_and_residual():
    _, reports, certificates = flight()
    assert certificates[-1].gap == np.inf
    assert certificates[-1].residual == reports[-1].result.residual


def test_it_survives_the_checkpoint():
    _, _, certificates = flight()
    assert certificates[-1].estimate.temporal > 0
    crossed = Occurrences(3, 4, 2, 7, 0.35, None, "cloth intersects itself", "triangles 3 and 17")
    certificate = replace(certificates[-1], intersections=IntersectionHistory(cloth_cloth=crossed, frames=(2, 3)))
    text = json.dumps(certificate.as_json())
    assert certificate_from(json.loads(text)) == certificate


def test_one_of_an_older_checkpoint_does_not_claim_what_was_not_checked():
    fields = json.loads(json.dumps(Certificate().as_json(), default=str))
    older = {name: fields[name] for name in fields if name != "intersections"}
    assert certificate_from({**older, "intersecting_frames": []}).as_dict({})["intersection_free"] is None
    assert certificate_from({**older, "intersecting_frames": [4]}).as_dict({})["intersection_free"] is False


def test_both_rises_of_the_energy_are_fractions_of_the_largest():
    reported = replace(Certificate(), energy_rise=1.0, step_rise=0.5, energy_scale=2.0).as_dict({})
    assert reported["energy_drift"] == 0.5
    assert reported["step_energy_rise"] == 0.25


def test_it_reports_what_was_checked_and_found():
    coverage = {"cloth_body": "no body", "cloth_cloth": "checked"}
    reported = Certificate().as_dict(coverage)
    assert coverage.items() <= reported.items()
    assert reported["intersection_free"] is True
    crossed = IntersectionHistory(cloth_cloth=Occurrences(1, 1, 1, 3, 0.1, 3, "a", "b"), frames=(3,))
    reported = Certificate(intersections=crossed).as_dict(coverage)
    assert (reported["intersection_free"], reported["intersecting_frames"]) == (False, [3])
    assert reported["intersections"]["cloth_cloth"]["first_step"] == 3
    assert Certificate(moved_by_script=True).as_dict(coverage)["energy_drift"] == "bodies, pins or wind do work"


PLATE = np.array([[-5.0, -4, 0], [5, -5, 0], [4.5, 5, 0], [-5, 5, 0]]), np.array([[0, 1, 2], [0, 2, 3]])


def estimated(reports):
    estimate = ErrorEstimate()
    for report in reports:
        estimate = estimate.after(report)
    return estimate


def flight_to(tolerance):
    rest, triangles = irregular_grid()
    world = make_world([replace(cloth(rest, triangles), positions=rest * [1.2, 0.9, 1.0])])
    energies = {"inertia": inertia(world), "membrane": membrane(world)}
    return run_of(integrator_of(world, energies, 0.05, tolerance=tolerance), 0.5)


def test_the_temporal_error_is_summed_over_the_steps():
    reports = flight_to(1e-6)
    reported = estimated(reports).as_dict()
    assert reported["temporal"] == pytest.approx(sum(report.error.rms for report in reports))
    assert reported["temporal_largest"] == pytest.approx(sum(report.error.largest for report in reports))
    assert reported["temporal_largest"] > reported["temporal"] > 1e-3
    assert reported["contact_gap"] == "not estimated (no contact)"
    assert "asked" not in reported


@pytest.mark.parametrize("tolerance", [1e-1, 1e-2])
def test_newton_s_part_tells_the_size_of_what_it_left(tolerance):
    """Against the same run solved to the end: not less than what is seen, and not a hundred times more."""
    coarse, exact = flight_to(tolerance), flight_to(1e-10)
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


def rattling():
    """B12e for .3 s, with steps of .003 s."""
    scene = on_wall(True, 0.5)
    return replace(
        scene, solver={**scene.solver, "dt": 0.003, "threads": 1}, run={"duration": 0.3, "frames_per_second": 50}
    )


@pytest.fixture(scope="module")
def rattled(tmp_path_factory):
    return clothsim.simulate(rattling(), tmp_path_factory.mktemp("whole"))


def test_the_record_balances_the_energy(rattled):
    """E(n+1) - E(n) less what the change of the stiffness added is the change in the step, which damps."""
    record = rattled.record()
    energy, changes = (np.array([entry[key] for entry in record]) for key in ("energy", "stiffness_energy"))
    in_step = np.diff(energy) - changes[1:]
    assert in_step.max() < 1e-9 * np.abs(energy).max()
    assert changes.max() > 1e-3 * np.abs(energy).max()
    certificate = rattled.summary["certificate"]["stiffness_changes"]
    assert certificate["added"] == pytest.approx(changes[changes > 0].sum(), rel=1e-12)
    assert certificate["removed"] == pytest.approx(-changes[changes < 0].sum(), rel=1e-12)


def test_a_stiff_card_comes_to_rest_with_small_steps(rattled):
    """With a stiffness that follows the loads at once 40 times the energy was added, and it was ten times as fast."""
    record = rattled.record()
    assert rattled.summary["certificate"]["stiffness_changes"]["added"] < 2e-5
    assert max(entry["fastest"] for entry in record[-20:]) < 0.02


def test_a_resumed_run_has_the_same_bits(rattled, tmp_path):
    """The stiffness of a step depends on that of the step before."""

    def stop(progress):
        if progress.time > 0.1:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        clothsim.simulate(rattling(), tmp_path, progress=stop)
    resumed = clothsim.resume(tmp_path)
    assert np.array_equal(resumed.positions(-1), rattled.positions(-1))
    assert resumed.summary["certificate"] == rattled.summary["certificate"]
    keys = ("energy", "stiffness_energy")
    assert [[e[k] for k in keys] for e in resumed.record()] == [[e[k] for k in keys] for e in rattled.record()]
