"""Branch switching: the elastica from a flat strip, either side, with and without inertia; what is stable stays."""

from dataclasses import replace

import numpy as np
import pytest
from meshes import cloth, grid, random_rotation
from solving import integrator_of

from clothsim.keys.fabric import Fabric
from clothsim.mesh.cloth import make_cloth
from clothsim.mesh.world import make_world
from clothsim.solve.stepping import time_loop
from clothsim.solve.stepping.integrators import BACKWARD_EULER, BDF2
from clothsim.solve.stepping.state import Rest, first_state
from clothsim.solve.stepping.time_loop import MOST_SWITCHES, STEPS_BETWEEN_LOOKS, steps
from tests.known_answers.elastica import elastica_height
from tests.support.effect_builders import bending, damping, gravity, inertia, membrane, pins

STRIP = Fabric(density=0.15, thickness=1e-3, youngs_modulus=1e6, poisson_ratio=0.0, bending_stiffness=1e-2)
LENGTH, CELLS = 0.5, 16
PRESSED = 0.8


def strip(dynamic, stretch=PRESSED, turned=None, load=None, formula=BACKWARD_EULER, **changes):
    """A flat strip, hinged at both ends and pressed along x; (integrator, its first state)."""
    points, triangles = grid(CELLS, 1, LENGTH, 0.05)
    ends = np.flatnonzero((points[:, 0] == 0) | (points[:, 0] == LENGTH))
    start = points * [stretch, 1, 1]
    start = start if turned is None else start @ random_rotation(turned).T
    pressed = make_cloth("strip", points, triangles, STRIP, positions=start)
    world, held = pins(make_world([pressed]), select=[int(e) for e in ends])
    energies = {"membrane": membrane(world), "bending": bending(world, model="midedge")}
    if dynamic:
        energies = {"inertia": inertia(world), "damping": damping(world, rate=10.0)} | energies
    if load is not None:
        energies["gravity"] = gravity(world, acceleration=load)
    integrator = integrator_of(world, energies, 0.02, {"pins": held})
    return replace(integrator, formula=formula, **changes), first_state(world, 0.02)


def last(case, duration=4.0, until="rest"):
    """All reports of a run; the last one ends at rest, or at the end."""
    integrator, state = case
    return list(steps(integrator, state, duration, 10.0, until))


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize(("dynamic", "formula"), [(False, BACKWARD_EULER), (True, BACKWARD_EULER), (True, BDF2)])
def test_a_flat_strip_buckles_in_its_first_mode_to_the_elastica(dynamic, formula, seed):
    case = strip(dynamic, formula=formula, perturbation_seed=seed)
    assert not case[1].positions[:, 2].any()
    reports = last(case, 4.0 if dynamic else 0.1)
    assert reports[-1].state.rest is Rest.REACHED
    x = reports[-1].state.positions
    assert elastica_height(PRESSED) == pytest.approx(0.2663, abs=5e-5)
    assert np.abs(x[:, 2]).max() / LENGTH == pytest.approx(elastica_height(PRESSED), rel=0.01)
    assert (x[:, 2] * x[len(x) // 2, 2] > -1e-12).all()  # one half wave
    switches = [switch for report in reports for switch in report.switches]
    assert len(switches) == 1
    assert switches[0].left
    assert switches[0].growth_rate > 100
    assert np.sign(switches[0].displacement[2]) == np.sign(x[len(x) // 2, 2])


def test_seeds_take_opposite_sides():
    sides = {}
    for seed in range(4):
        x = last(strip(False, perturbation_seed=seed), 0.1)[-1].state.positions
        sides[seed] = np.sign(x[len(x) // 2, 2])
    assert sides[0] == -sides[1]
    assert sides[2] == -sides[3]


@pytest.mark.parametrize("dynamic", [False, True])
def test_the_same_seed_gives_the_same_bits(dynamic):
    first, second = (last(strip(dynamic), 0.3, "time")[-1].state.positions for _ in range(2))
    assert np.array_equal(first, second)


@pytest.mark.parametrize("turned", [0, 1])
def test_a_strip_in_any_plane_leaves_it(turned):
    case = strip(True, turned=turned)
    reports = last(case)
    x = reports[-1].state.positions @ random_rotation(turned)
    assert np.ptp(x[:, 2]) / LENGTH == pytest.approx(elastica_height(PRESSED), rel=0.01)


def test_a_load_decides_the_side():
    for push in (-0.5, 0.5):
        for seed in (0, 1):
            x = last(strip(False, load=(0, 0, push), perturbation_seed=seed), 0.1)[-1].state.positions
            assert np.sign(x[len(x) // 2, 2]) == np.sign(push)


def test_a_kept_equilibrium_is_recorded_and_stays():
    reports = last(strip(False, leaves_unstable=False), 0.1)
    assert not reports[-1].state.positions[:, 2].any()
    assert [switch.left for switch in reports[-1].switches] == [False]
    moving = last(strip(True, leaves_unstable=False), 0.5)
    assert not moving[-1].state.positions[:, 2].any()
    assert moving[-1].state.rest is Rest.UNSTABLE  # kept, which is no rest
    assert any(report.switches for report in moving)


def test_a_step_that_is_unstable_after_its_last_switch_says_so(monkeypatch):
    monkeypatch.setattr(time_loop, "MOST_SWITCHES", 0)
    reports = last(strip(False), 0.1)
    assert [switch.left for switch in reports[-1].switches] == [False]
    assert reports[-1].state.rest is Rest.UNSTABLE


@pytest.mark.parametrize("dynamic", [False, True])
@pytest.mark.parametrize("stretch", [1.0, 1.3])
def test_a_stable_flat_strip_is_left_in_place_with_the_same_bits(stretch, dynamic):
    left, kept = (last(strip(dynamic, stretch, leaves_unstable=leaves), 0.5, "time") for leaves in (True, False))
    assert not any(report.switches for report in left)
    assert np.array_equal(left[-1].state.positions, kept[-1].state.positions)
    assert not left[-1].state.positions[:, 2].any()
    assert left[-1].state.at_rest


def test_a_sheet_without_load_takes_no_iteration_and_keeps_its_bits():
    """Its rigid modes have no stiffness, and are no instability."""
    points, triangles = grid(6, 4, 0.3, 0.2)
    world = make_world([cloth(points @ random_rotation(2).T, triangles, STRIP)])
    energies = {"inertia": inertia(world), "membrane": membrane(world), "bending": bending(world)}
    reports = last((integrator_of(world, energies, 0.01), first_state(world, 0.01)), 1.0)
    assert max(report.result.iterations for report in reports) <= 1
    assert not any(report.switches for report in reports)
    assert np.abs(reports[-1].state.positions - world.start()).max() < 1e-15
    assert reports[-1].state.at_rest


def test_a_moving_cloth_in_its_plane_is_looked_at_every_few_steps():
    """Pressed by a pin: it leaves the plane at the first look, though it is never slow; later looks find it outside."""
    points, triangles = grid(CELLS, 1, LENGTH, 0.05)
    right = [int(v) for v in np.flatnonzero(points[:, 0] == LENGTH)]
    left = [int(v) for v in np.flatnonzero(points[:, 0] == 0)]
    groups = [{"select": left}, {"select": right, "motion": {"velocity": (-0.2, 0, 0)}}]
    world, held = pins(make_world([cloth(points, triangles, STRIP)]), group=groups)
    energies = {"inertia": inertia(world), "membrane": membrane(world), "bending": bending(world)}
    integrator = integrator_of(world, energies, 0.01, {"pins": held})
    reports = last((integrator, first_state(world, 0.01)), 0.5, "time")
    found = [report.state.step for report in reports if report.switches]
    assert len(found) == 1
    assert found[0] % STEPS_BETWEEN_LOOKS == 1
    assert np.abs(reports[-1].state.positions[:, 2]).max() > 0.1 * LENGTH


def test_switches_of_a_step_are_bounded():
    most = max(len(report.switches) for report in last(strip(False, stretch=0.3), 0.1))
    assert 1 <= most <= MOST_SWITCHES


def test_a_repetition_that_fails_is_tried_once_and_the_state_counts_as_kept():
    """With 10 iterations the way from the flat sheet is too long; shorter steps, which are not taken, are not tried."""
    points, triangles = grid(4, 4, 0.4, 0.4)
    sheet = make_cloth("sheet", points, triangles, STRIP, positions=points * [0.99, 1, 1])
    ends = np.flatnonzero((points[:, 0] == 0) | (points[:, 0] == points[:, 0].max()))
    world, held = pins(make_world([sheet]), select=[int(e) for e in ends])
    integrator = integrator_of(world, {"membrane": membrane(world)}, 0.1, {"pins": held})
    integrator = replace(integrator, settings=replace(integrator.settings, max_iterations=1))
    reports = last((integrator, first_state(world, 0.1)), 0.1)
    assert [[switch.left for switch in report.switches] for report in reports] == [[False]]
    assert reports[-1].state.rest is Rest.UNSTABLE
    assert not reports[-1].state.positions[:, 2].any()
    assert integrator.potential.timers.linear_solves < 20


def test_the_second_mode_is_left_for_the_first():
    """A point-symmetric start with two half waves is a saddle, too."""
    case = strip(False)
    integrator, state = case
    n = integrator.world.n_cloth
    flat = integrator.world.start()[:n]
    state.positions[:n, 2] = 0.13 * LENGTH * np.sin(2 * np.pi * flat[:, 0] / (PRESSED * LENGTH))
    state.positions[np.abs(state.positions[:, 2]) < 1e-12, 2] = 0.0
    x = last((integrator, state), 0.1)[-1].state.positions
    assert (x[:, 2] * x[len(x) // 2, 2] > -1e-9).all()
    assert np.abs(x[:, 2]).max() / LENGTH == pytest.approx(elastica_height(PRESSED), rel=0.01)


def test_a_slow_cloth_far_from_equilibrium_is_not_displaced():
    """A strip bent to a wrong height, under a damping that makes it creep: compressed, but with a way of its own."""
    integrator, state = strip(True)
    creeping = {**integrator.potential.energies, "damping": damping(integrator.world, rate=1e7)}
    integrator = replace(integrator, potential=replace(integrator.potential, energies=creeping))
    n = integrator.world.n_cloth
    state.positions[:n, 2] = 0.05 * LENGTH * np.sin(np.pi * integrator.world.start()[:n, 0] / (PRESSED * LENGTH))
    state.positions[np.abs(state.positions[:, 2]) < 1e-12, 2] = 0.0
    reports = last((integrator, state), 0.5)
    assert reports[-1].fastest < integrator.rest_speed
    assert reports[-1].state.rest is Rest.DISTANT
    assert not any(report.switches for report in reports)


def test_the_normal_of_a_plane_far_from_the_origin():
    turn = random_rotation(4)
    points = np.column_stack([np.random.default_rng(5).uniform(size=(6, 2)), np.full(6, 7.0)])
    assert np.abs(np.abs(time_loop._normal(points @ turn.T)) - np.abs(turn[:, 2])).max() < 1e-12
    points[3, 2] += 1e-3
    assert time_loop._normal(points @ turn.T) is None
    assert time_loop._normal(np.linspace(points[0], points[1], 5)) is None
