"""Springs, tethers and soft pins against closed forms: selection, motion, and refused input."""

from dataclasses import replace

import numpy as np
import pytest
from effect_builders import gravity, inertia, membrane, springs
from meshes import cloth, grid
from small_scenes import EFFECTS, SHEET, small_scene
from solving import equilibrium, integrator_of, run_of, step_at, those_on

from clothsim import simulate
from clothsim.base.errors import InputError
from clothsim.mesh.world import make_world
from clothsim.physics.energies.base import Off
from clothsim.scene.assembly.scene_world import build

ALL = {"box": [[-9, -9, -9], [9, 9, 9]]}


def sheet(n=2):
    return make_world([cloth(*grid(n, n))])


def triangle():
    """One triangle: three equal masses, so that equal springs carry it without strain."""
    return make_world([cloth(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]]))])


def one(world, **keys):
    return springs(world, spring=[{"select": ALL, "stiffness": 40.0, **keys}])


@pytest.mark.parametrize("keys", [{}, {"offset": [0, 0, 0.3]}, {"offset": [0, 0, 0.3], "slack": True}])
def test_a_hanging_weight_extends_its_springs_by_its_weight_over_their_stiffness(keys):
    world = triangle()
    energies = those_on(springs=one(world, **keys), gravity=gravity(world), membrane=membrane(world))
    start = world.start() - np.array([0, 0, 0.01])
    sunk = world.start() - equilibrium(world, energies, start)
    np.testing.assert_allclose(sunk[:, 2], world.masses * 9.81 / 40.0, rtol=1e-9)
    assert np.abs(sunk[:, :2]).max() < 1e-9


def test_a_spring_pushes_where_it_is_short_and_a_tether_does_not():
    world = triangle()
    near = world.start() + np.array([0, 0, 0.1])
    spring, tether = (one(world, offset=[0, 0, 0.3], slack=slack).begin(step_at(near)) for slack in (False, True))
    np.testing.assert_allclose(spring.gradient(near)[:, 2], 40.0 * 0.1)
    assert spring.value(near) == pytest.approx(3 * 20.0 * 0.1**2)
    assert tether.value(near) == 0.0
    assert not tether.gradient(near).any()
    assert not len(tether.hessian(near).elements)
    assert tether.value(world.start() - [0, 0, 0.1]) == pytest.approx(3 * 20.0 * 0.1**2)


def test_a_tether_that_never_pulls_is_absent_bit_for_bit(tmp_path):
    runs = []
    for k, spring in enumerate(([], [{"select": "corners", "stiffness": 1e3, "rest_length": 0.5, "slack": True}])):
        scene = small_scene(effects=EFFECTS | ({"springs": {"spring": spring}} if spring else {}))
        run = simulate(scene, tmp_path / str(k))
        assert run.status == "completed", run.reason
        runs.append([run.positions(frame) for frame in range(len(run.times))])
    assert np.array_equal(*runs)
    assert np.abs(runs[0][-1] - runs[0][0]).max() > 0.05


def test_an_oscillator_has_the_period_of_its_mass_and_stiffness():
    """Rigid up and down: 2 pi sqrt(m/k), from where it passes the middle, with BDF2."""
    world = triangle()
    mass, k = world.masses[0], 40.0
    period = 2 * np.pi * np.sqrt(mass / k)
    moved = replace(world.cloths[0], velocity=np.array([0.0, 0.0, 0.5]))
    world = make_world([moved])
    energies = those_on(inertia=inertia(world), springs=one(world))
    errors = []
    for steps in (50, 100):
        integrator = replace(integrator_of(world, energies, period / steps, tolerance=1e-10), formula="bdf2")
        states = [report.state for report in run_of(integrator, 1.2 * period, steps / period)]
        times, heights = np.array([s.time for s in states]), np.array([s.positions[0, 2] for s in states])
        up = np.flatnonzero((heights[:-1] < 0) & (heights[1:] >= 0))[-1]
        crossing = times[up] - heights[up] * (times[up + 1] - times[up]) / (heights[up + 1] - heights[up])
        errors.append(abs(crossing / period - 1))
    assert errors[0] < 0.02
    assert errors[1] < 0.006
    assert 1.7 < np.log2(errors[0] / errors[1]) < 2.4


def test_soft_pins_follow_motion_and_path():
    world = triangle()
    motion = {"velocity": [1.0, 0.0, 0.0], "rotate_degrees_per_second": [0, 0, 90.0], "centre": [0, 0, 0]}
    energy = one(world, motion=motion, path=[[0.0, 0, 0, 0], [1.0, 0, 0, 2.0]])
    assert energy.drives
    there = energy.begin(replace(step_at(world.start(), dt=0.5), time=0.5))
    np.testing.assert_allclose(there.targets, [[1, 0, 2], [1, 1, 2], [0, 0, 2]], atol=1e-12)
    x = equilibrium(world, {"springs": replace(energy, anchors=tuple(energy.anchors))}, world.start())
    np.testing.assert_allclose(x, [[1, 0, 2], [1, 1, 2], [0, 0, 2]], atol=1e-9)  # the step ends at 1 s


def test_still_springs_drive_nothing_and_hold_their_vertices():
    world = sheet()
    energy = springs(world, spring=[{"select": "left", "stiffness": 3.0}])
    assert not energy.drives
    assert energy.anchored_rows.tolist() == [0, 1, 2]
    assert not energy.lengths.any()


def test_a_quasi_static_cloth_may_hang_from_springs(tmp_path):
    tied = {"spring": [{"select": "top", "stiffness": 50.0}]}
    effects = {"membrane": {}, "bending": {}, "gravity": {}, "springs": tied}
    scene = small_scene(cloth=SHEET, body=(), effects=effects, run={"duration": 0.1})
    run = simulate(scene, tmp_path)
    assert run.status == "completed", run.reason
    top = run.positions(0)[:, 1] > 0.49
    sunk = (run.positions(0)[top] - run.positions(-1)[top]).sum(axis=0)
    weight = build(scene).world.masses.sum() * 9.81
    np.testing.assert_allclose(50.0 * sunk, [0, 0, weight], atol=1e-3 * weight)


def test_a_stiffness_over_time_is_that_at_the_end_of_the_step():
    energy = one(triangle(), stiffness=[[0.0, 0.0], [2.0, 10.0]])
    assert energy.drives
    assert energy.begin(step_at(triangle().start(), dt=1.0)).stiffnesses.tolist() == [5.0, 5.0, 5.0]


def test_the_world_s_own_origin_does_not_matter():
    far = replace(cloth(*grid(1, 1)), positions=grid(1, 1)[0] + np.array([500.0, 0, 0]))
    world = make_world([far])
    shifted = replace(make_world([cloth(*grid(1, 1))]), origin=np.array([500.0, 0, 0]))
    turn = {"rotate_degrees_per_second": [0, 0, 9]}
    keys = {
        "select": [0],
        "stiffness": 1.0,
        "to": [501.0, 2.0, 0.0],
        "motion": turn,
    }
    here, there = (springs(w, spring=[keys]).begin(step_at(w.start())) for w in (world, shifted))
    np.testing.assert_allclose(here.targets - [500, 0, 0], there.targets, atol=1e-12)
    np.testing.assert_allclose(here.lengths, there.lengths)


def test_nothing_to_pull_is_off():
    assert springs(sheet()) == Off("there is no spring")
    assert one(sheet(), stiffness=0) == Off("every stiffness is 0")


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"stiffness": 1}, r"spring\[0\] has no select"),
        ({"select": "left"}, r"spring\[0\] has no stiffness"),
        ({"select": "lefft", "stiffness": 1}, r"spring\[0\].select is 'lefft'"),
        ({"select": [], "stiffness": 1}, r"spring\[0\] selects no vertex"),
        ({"select": "left", "stiffness": -1}, "stiffness must be at least 0"),
        ({"select": "left", "stiffness": 1, "to": [0, 0, 1], "offset": [0, 0, 1]}, "to and offset"),
        ({"select": "left", "stiffness": 1, "to": [0, 1]}, "to must be 3 numbers"),
        ({"select": "left", "stiffness": 1, "slack": 1}, "slack must be true or false"),
        ({"select": "left", "stiffness": 1, "rest_length": -1}, "rest_length must be at least 0"),
        ({"select": "left", "stiffness": 1, "motion": {"speed": 1}}, r"spring\[0\].motion has no key 'speed'"),
        ({"select": "left", "stiffness": 1, "motion": 3}, "motion must be a table"),
        ({"select": "left", "stiffness": 1, "path": [[0, 0, 0, 0], [0, 1, 1, 1]]}, r"path\[1\] is not after"),
        ({"select": "left", "stiffness": 1, "path": [[0, 1]]}, "path must have shape"),
        ({"select": "left", "stiffness": 1, "damping": 1}, "no key 'damping'"),
    ],
)
def test_bad_springs_are_refused_in_one_sentence(keys, words):
    with pytest.raises(InputError, match=words):
        springs(sheet(), spring=[keys])
