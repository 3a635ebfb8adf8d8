"""Bounds on motion in a step."""

from types import SimpleNamespace

import numpy as np
import pytest
from small_scenes import RUN, SHEET, SOLVER, small_scene

from clothsim import InputError, Simulation, simulate
from clothsim.solve.stepping import stepping
from clothsim.solve.stepping.local_error import ErrorControl
from clothsim.solve.stepping.state import State

HELD = {"inertia": {}, "membrane": {}, "gravity": {}}


def pinned(**motion):
    return small_scene(body=(), effects=HELD | {"pins": {"select": "left", "motion": motion}}, run=RUN)


@pytest.mark.parametrize("speed", [2260.0, 18_000.0, 1e30])
def test_pins_that_turn_by_more_than_45_degrees_a_step_are_refused(tmp_path, speed):
    """18,000 degrees/s at .02 s is a full turn: nothing moved, and the run was completed."""
    with pytest.raises(InputError, match=r"pins turns .* degrees in a step"):
        simulate(pinned(rotate_degrees_per_second=[0, speed, 0]), tmp_path)


def test_a_group_is_named_and_a_slower_one_turns(tmp_path):
    group = {"select": "right", "motion": {"rotate_degrees_per_second": [4000, 0, 0]}}
    pins = {"select": "left", "motion": {"rotate_degrees_per_second": [0, 2000, 0]}}
    with pytest.raises(InputError, match=r"pins\.group\[0\] turns 80 degrees"):
        simulate(small_scene(body=(), effects=HELD | {"pins": pins | {"group": [group]}}), tmp_path)
    run = simulate(small_scene(body=(), effects=HELD | {"pins": pins}, run=RUN | {"duration": 0.04}), tmp_path)
    moved = np.abs(run.positions(-1) - run.positions(0)).max()
    assert run.status == "failed" or moved > 0


@pytest.mark.parametrize("speed", [1e6, 1e30, 1e300])
def test_pins_that_fly_away_are_refused(tmp_path, speed):
    with pytest.raises(InputError, match=r"pins moves .* times the size"):
        simulate(pinned(velocity=[0, speed, 0]), tmp_path)


def test_pins_driven_by_hand_are_bound_too():
    simulation = Simulation(pinned())
    with pytest.raises(InputError, match="degrees in a step"):
        simulation.drive_pins(rotate_degrees_per_second=[0, 18_000, 0])
    simulation.drive_pins(rotate_degrees_per_second=[0, 1000, 0])
    assert simulation.step().step == 1


def test_an_error_that_no_step_meets_ends_at_the_bound_of_tries(monkeypatch):
    """Round-off kept a step a hair above the shortest, and was retried until the list of failed tries was asked for."""
    scene = small_scene(
        body=(), cloth=SHEET | {"cells": [2, 2]}, effects=HELD, solver={"error": 1e-4, "linear": "superlu"}
    )
    monkeypatch.setattr(ErrorControl, "exceeds", lambda self, state, h, error: True)
    monkeypatch.setattr(ErrorControl, "retry", lambda self, state, h, error: h * (1 - 1e-9))
    monkeypatch.setattr(stepping, "MOST_TRIES", 5)
    simulation = Simulation(scene)
    assert simulation.step().step == 1


@pytest.mark.parametrize(("above", "is_retried"), [(0.0, False), (1e-12, False), (1e-9, False), (1e-3, True)])
def test_a_step_that_round_off_lengthens_is_the_shortest_one(above, is_retried):
    control = ErrorControl(1e-12, 1.0, 0.02)
    state = State(0.0, 0.02, 0, 0, np.zeros((1, 3)), np.zeros((1, 3)))
    h = control.shortest * (1 + above)
    next_h = stepping._shorter(SimpleNamespace(control=control), state, h, SimpleNamespace(rms=1.0))
    assert (next_h < h) == is_retried


@pytest.mark.parametrize(
    "sections",
    [
        {"run": RUN | {"duration": 1e-300}},
        {"run": RUN | {"frames_per_second": 1e13}},
        {"solver": SOLVER | {"dt": 1e-13}},
    ],
)
def test_steps_shorter_than_any_motion_are_refused(tmp_path, sections):
    with pytest.raises(InputError, match=r"Steps of .* s"):
        simulate(small_scene(body=(), effects=HELD, **sections), tmp_path, force=True)
