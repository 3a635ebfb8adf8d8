"""run.budget: CPU time of the steps of a run, its end as failed, and the runs that go on from there."""

import numpy as np
import pytest

from clothsim import InputError, Scene, resume, simulate
from clothsim.base.errors import ClothsimError
from clothsim.gradients.losses import Height
from clothsim.gradients.run import traced
from clothsim.run.session import last_positions
from clothsim.solve.stepping import time_loop

STEPS = 8
"""Steps of the scene, two a frame."""


def falling(**run):
    """A sheet of two triangles that falls."""
    cloth = {"mesh": "rectangle", "size": [0.1, 0.1], "cells": [1, 1]}
    settings = {"duration": 0.04, "frames_per_second": 100, **run}
    solver = {"dt": 0.005, "threads": 1, "linear": "superlu"}
    return Scene(cloth=cloth, effects={"inertia": {}, "gravity": {}}, solver=solver, run=settings)


@pytest.fixture
def clock(monkeypatch):
    """CPU time that grows by a second each time it is read."""
    read = []
    monkeypatch.setattr(time_loop, "process_time", lambda: float(len(read.append(0) or read)))


@pytest.mark.usefixtures("clock")
@pytest.mark.parametrize(("budget", "steps", "completed"), [(0.5, 1, False), (2.5, 3, False), (7.5, 8, True)])
def test_a_run_ends_with_the_step_that_spends_its_budget(tmp_path, budget, steps, completed):
    run = simulate(falling(budget=budget), tmp_path)
    assert len(run.record()) == steps
    assert (run.status == "completed") == completed
    if not completed:
        failure = run.summary["failure"]
        assert (failure["cause"], failure["step"]) == ("budget", steps)
        assert failure["time"] == pytest.approx(0.005 * steps)


@pytest.mark.usefixtures("clock")
def test_each_resumed_run_has_a_budget_of_its_own(tmp_path):
    run = simulate(falling(budget=3.5), tmp_path / "parts")
    assert (run.status, len(run.record())) == ("failed", 4)
    run = resume(tmp_path / "parts")
    assert (run.status, len(run.record())) == ("completed", STEPS)
    assert np.array_equal(run.positions(-1), simulate(falling(), tmp_path / "whole").positions(-1))


@pytest.mark.usefixtures("clock")
def test_a_step_that_the_budget_left_out_has_no_iterates(tmp_path):
    simulate(falling(budget=0.5), tmp_path, dump_iterates=2)
    assert not list(tmp_path.glob("iterates*"))


@pytest.mark.usefixtures("clock")
def test_a_budget_of_one_run_is_not_of_its_scene(tmp_path):
    run = simulate(falling(budget=0.5), tmp_path / "of a scene", budget=3.5)
    assert (len(run.record()), run.scene.run_settings.budget) == (4, 0.5)
    run = simulate(falling(), tmp_path / "one", budget=3.5)
    assert (run.status, len(run.record()), run.scene.run_settings.budget) == ("failed", 4, None)
    assert resume(tmp_path / "one").status == "completed"


@pytest.mark.usefixtures("clock")
def test_runs_without_files_and_with_gradients_have_it_too():
    assert "budget" in last_positions(falling(budget=0.5))[2]
    assert last_positions(falling(budget=100.0))[2] == ""
    with pytest.raises(ClothsimError, match="budget"):
        traced(falling(budget=0.5)).gradient(Height())


@pytest.mark.parametrize("budget", [0.0, -1.0, float("nan"), "90s", True])
def test_a_budget_is_a_positive_number(budget):
    with pytest.raises(InputError, match="budget"):
        falling(budget=budget)
    with pytest.raises(InputError, match="budget"):
        simulate(falling(), budget=budget)


def test_a_differentiable_run_has_that_of_its_scene():
    with pytest.raises(InputError, match=r"run\.budget"):
        simulate(falling(), budget=1.0, differentiable=True)
