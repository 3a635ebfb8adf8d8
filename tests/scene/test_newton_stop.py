"""[solver] newton_error_fraction and tolerance: which of them stops Newton's method."""

from dataclasses import replace

import numpy as np
import pytest
from small_scenes import small_scene, without

from clothsim import InputError, simulate
from clothsim.keys.settings import CONVERGED
from clothsim.run.session import prepare
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.paths import override
from clothsim.solve.newton.convergence import LEAST_SPEED


def settings(**solver):
    scene = small_scene(solver={"dt": 0.02, "threads": 1, "linear": "superlu", **solver})
    return prepare(scene, build(scene)).integrator.settings


def test_the_motion_stops_newton_where_no_tolerance_is_given():
    chosen, half = settings(), settings(newton_error_fraction=0.15)
    assert (chosen.error_fraction, chosen.converge) == (0.3, False)
    assert half.error_fraction == 0.15
    assert half.tolerance == pytest.approx(0.5 * chosen.tolerance)


def test_the_least_speed_is_that_of_a_fall_by_a_part_of_a_cell():
    """At ten times the size and the same gravity speeds are 10^1/2 times as large."""
    small, large = ([{"mesh": "rectangle", "size": [s, s], "cells": [4, 4]}] for s in (0.5, 5.0))
    speeds = []
    for cloth in (small, large):
        scene = small_scene(cloth=cloth, body=(), effects=without("body_contact"))
        speeds.append(prepare(scene, build(scene)).integrator.settings.tolerance)
    assert speeds[1] == pytest.approx(10**0.5 * speeds[0])


@pytest.mark.parametrize("solver", [{"converge": True}, {"error": 0.01}])
def test_a_step_is_converged_where_it_is_asked_for(solver):
    solver = {"converge": True} if "converge" in solver else solver
    scene = small_scene()
    given = {key: value for key, value in scene.solver.items() if key != "dt"} if "error" in solver else scene.solver
    scene = replace(scene, solver={**given, **solver})
    found = prepare(scene, build(scene)).integrator.settings
    assert (found.error_fraction, found.converge) == (CONVERGED, True)


@pytest.mark.parametrize("tolerance", [1e-3, 1e-2])
def test_a_tolerance_takes_its_place(tolerance):
    given = settings(tolerance=tolerance)
    assert (given.error_fraction, given.tolerance) == (0.0, tolerance)


def test_both_exclude_each_other():
    with pytest.raises(InputError, match="newton_error_fraction and tolerance"):
        settings(tolerance=1e-3, newton_error_fraction=0.1)
    scene = override(small_scene(solver={"newton_error_fraction": 0.2}), "solver.tolerance=1e-2")
    assert scene.solver == {"tolerance": 1e-2}


@pytest.mark.parametrize("fraction", [0, -0.1, 1.5, "small"])
def test_a_fraction_is_a_part_of_one(fraction):
    with pytest.raises(InputError, match=r"solver\.newton_error_fraction must be"):
        settings(newton_error_fraction=fraction)


def test_without_inertia_a_step_ends_by_what_it_moved_whatever_its_length(tmp_path):
    effects = without("inertia", "body_contact", "damping") | {"pins": {"select": "left"}}
    runs = [
        simulate(small_scene(effects=effects, body=(), solver={"threads": 1, **solver}), tmp_path / str(k))
        for k, solver in enumerate([{"dt": 0.08}, {"dt": 0.04}, {"dt": 0.08, "tolerance": 1e-3 * LEAST_SPEED}])
    ]
    moved = np.abs(runs[2].positions(-1) - runs[2].positions(0)).max()
    for run in runs[:2]:
        assert np.abs(run.positions(-1) - runs[2].positions(-1)).max() < 1e-3 * moved
