"""Energy of BDF2 at impacts: steps that would gain are repeated with backward Euler, smooth motion is not."""

from dataclasses import replace

import numpy as np
import pytest
from effect_builders import gravity, inertia, membrane
from meshes import deformed, small_world
from small_scenes import SHEET, small_scene, without
from solving import step_at

from clothsim import simulate
from clothsim.solve.newton.potential import Potential
from clothsim.solve.stepping.mechanical_energy import ALLOWED, mechanical_energy
from clothsim.solve.stepping.state import first_state
from clothsim.solve.timers import Timers

PLATE = {"mesh": "slab", "size": [3.0, 3.0, 0.1], "name": "plate"}


def test_the_energy_of_a_thrown_sheet_is_that_of_its_speed_height_and_stretch():
    """Gravity as -m g z; the incremental potential has the energy of inertia besides, which is stored nowhere."""
    world = small_world()
    energies = {"membrane": membrane(world), "inertia": inertia(world), "gravity": gravity(world)}
    x, v = deformed(world, 2, 0.05), np.tile([0.3, -0.2, 1.5], (len(world.start()), 1))
    potential = Potential(energies, Timers()).begin(step_at(world.start(), v, 0.1))
    found = mechanical_energy(world, potential, replace(first_state(world, 0.1), positions=x, velocities=v))
    mass = world.masses[: world.n_cloth]
    kinetic = 0.5 * mass.sum() * (v[0] @ v[0])
    height = 9.81 * float(mass @ x[: world.n_cloth, 2])
    assert found.kinetic == pytest.approx(kinetic, rel=1e-12)
    assert found.total == pytest.approx(kinetic + height + energies["membrane"].value(x), rel=1e-12)
    assert found.incremental == pytest.approx(potential.value(x), rel=1e-12)
    assert found.incremental != pytest.approx(found.total, rel=0.1)


def thrown(**solver):
    """Summary of a sheet that is thrown at a plate with 50 m/s."""
    cloth = SHEET | {"position": [0.0, 0.0, 1.0], "rotation_degrees": [2.0, 1.0, 0.0], "velocity": [0.0, 0.0, -50.0]}
    run = {"duration": 0.1, "frames_per_second": 50}
    scene = small_scene(cloth, PLATE, without("damping"), {"dt": 0.01, "threads": 1, **solver}, run)
    return simulate(scene).summary


def test_an_impact_adds_no_energy():
    summary = thrown()
    assert summary["status"] == "completed", summary["reason"]
    assert summary["restarted_steps"] > 0
    assert summary["certificate"]["energy_drift"] <= ALLOWED
    assert summary["certificate"]["intersections"]["cloth_body"]["pairs"] == 0


def test_backward_euler_is_never_restarted():
    assert thrown(integrator="backward_euler")["restarted_steps"] == 0


def test_a_sheet_that_nothing_moves_meets_no_impact():
    """Its energy is round-off, which grows and falls from step to step."""
    effects = {"inertia": {}, "membrane": {}, "bending": {}}
    scene = small_scene(body=(), effects=effects, run={"duration": 0.3, "frames_per_second": 50})
    summary = simulate(scene).summary
    assert summary["restarted_steps"] == 0
    assert abs(summary["certificate"]["energy_drift"]) < 1e-6


def test_a_sheet_that_swings_without_contact_stays_with_bdf2():
    effects = without("body_contact", "damping") | {"pins": {"select": "left"}}
    scene = small_scene(body=(), effects=effects, run={"duration": 0.6, "frames_per_second": 25})
    assert simulate(scene).summary["restarted_steps"] == 0


@pytest.mark.parametrize("speed", [0.5, 4.0])
def test_a_sheet_that_a_fast_plate_drags_stays_with_bdf2(speed):
    """Friction speeds it up by more than a tenth of its kinetic energy in a step: the work of the plate, no gain."""
    cloth = SHEET | {"position": [0.0, 0.0, 0.0015]}
    plate = PLATE | {"position": [0.0, 0.0, -0.05], "motion": {"velocity": [speed, 0.0, 0.0]}}
    effects = without("damping") | {"body_contact": {"d_hat": 2e-3}, "friction": {"coefficient": 0.5, "iterations": 3}}
    run = {"duration": 0.1, "frames_per_second": 50}
    result = simulate(small_scene(cloth, plate, effects, {"dt": 0.01, "threads": 1}, run))
    assert result.summary["restarted_steps"] == 0
    moved = (result.positions(-1) - result.positions(0)).mean(axis=0)[0]
    acceleration = 0.5 * 9.81
    at_speed = min(0.1, speed / acceleration)
    assert moved == pytest.approx(0.5 * acceleration * at_speed**2 + speed * (0.1 - at_speed), rel=0.1)


def test_an_impact_is_the_same_in_a_frame_that_moves():
    heights = []
    for speed in (0.0, 50.0):
        cloth = SHEET | {"position": [0.0, 0.0, 1.0], "rotation_degrees": [2.0, 1.0, 0.0]}
        cloth |= {"velocity": [0.0, 0.0, speed - 50.0]}
        plate = PLATE | {"motion": {"velocity": [0.0, 0.0, speed]}}
        run = {"duration": 0.1, "frames_per_second": 50}
        result = simulate(small_scene(cloth, plate, without("damping"), {"dt": 0.01, "threads": 1}, run))
        heights.append(result.positions(-1)[:, 2].mean() - speed * 0.1)
    assert heights[1] == pytest.approx(heights[0], rel=0.15)
