"""Error estimate by coarser runs: not known where they end in another shape; contact counts where it acts."""

from dataclasses import replace

import pytest

from clothsim import Scene, simulate
from clothsim.study.error_control import coarser_run, resolution
from clothsim.study.error_control.resolution import Differences, acting, trial_at
from tests.known_answers.error_scenes import ERROR_SCENES


@pytest.mark.parametrize(("fraction", "known"), [(1e-9, False), (10.0, True)])
def test_a_coarser_run_of_another_shape_says_nothing_of_the_error(fraction, known, monkeypatch):
    monkeypatch.setattr(resolution, "ANOTHER_SHAPE", fraction)
    scene = ERROR_SCENES["twisted"]
    run = simulate(replace(scene, solver={**scene.solver, "estimate": True}))
    estimate = run.summary["certificate"]["error_estimate"]
    assert estimate["known"] is known
    assert ("coarser runs" in estimate["fixed"]) is not known
    assert estimate["total"] > 0


@pytest.mark.parametrize(("depth", "known"), [(1.0, True), (0.003, False)])
def test_contact_that_touches_in_no_run_is_none_to_its_error(depth, known, monkeypatch):
    """Differences that fall by order 2 and turn over were "not known" of every scene with an effect of contact."""
    monkeypatch.setattr(coarser_run, "differences_of", lambda *trials: Differences(1e-3, 4e-3, -0.9))
    scene = Scene(
        cloth={"mesh": "rectangle", "size": [0.3, 0.1], "cells": [8, 4], "fabric": "cotton"},
        body={"mesh": "slab", "size": [1.0, 1.0, 0.1], "position": [0.0, 0.0, -0.05 - depth]},
        effects={"inertia": {}, "membrane": {}, "gravity": {}, "body_contact": {"d_hat": 2e-3}},
        solver={"dt": 0.01, "estimate": True},
        run={"duration": 0.04, "frames_per_second": 25},
    )
    run = simulate(scene)
    gap = run.summary["certificate"]["minimum_gap"]
    assert (gap is None) is known
    assert run.summary["certificate"]["error_estimate"]["known"] is known
    refinable = resolution.refinable_scene(scene)
    trial = trial_at(refinable.at(resolution.Resolution(4), 0.1), resolution.Resolution(4))
    assert trial.touched is not known
    assert ("d_hat" in acting(refinable.parameters, [trial])) is not known
    assert "dt" in acting(refinable.parameters, [trial])


def test_a_frame_of_too_few_steps_says_which_dt_is_short_enough():
    scene = ERROR_SCENES["twisted"]
    rate = scene.run_settings.frames_per_second
    run = simulate(replace(scene, solver={**scene.solver, "dt": 1 / (2 * rate), "estimate": True}))
    assert f"solver.dt = {1 / (4 * rate):.3g}" in run.summary["certificate"]["error_estimate"]["fixed"]["dt"]
