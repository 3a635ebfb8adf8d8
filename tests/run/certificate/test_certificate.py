"""Certificate: extremes over steps, and its round trip through the checkpoint."""

import json
from dataclasses import replace

import numpy as np
import pytest
from effect_builders import bending, gravity, inertia, membrane
from meshes import cloth, deformed, irregular_grid, small_world
from solving import integrator_of, run_of

from clothsim.mesh.world import make_world
from clothsim.run.certificate.certificate import Certificate, certificate_from, world_stretches
from clothsim.run.certificate.intersection_history import IntersectionHistory, Occurrences
from clothsim.solve.stepping.state import first_state


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
