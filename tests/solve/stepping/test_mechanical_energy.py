"""Energy of BDF2 at impacts: steps that would gain are repeated with backward Euler, smooth motion is not."""

import pytest
from small_scenes import SHEET, small_scene, without

from clothsim import simulate
from clothsim.solve.stepping.mechanical_energy import ALLOWED

PLATE = {"mesh": "slab", "size": [3.0, 3.0, 0.1], "name": "plate"}


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
