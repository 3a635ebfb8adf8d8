"""Studies of simulated scenes: nothing is stated early, and one push is counted once."""

from dataclasses import asdict, replace
from fractions import Fraction

import numpy as np
import pytest

from clothsim.scene import paths
from clothsim.scene.assembly.refinement import with_cells
from clothsim.scene.scene import Scene
from clothsim.study import workers
from clothsim.study.evaluation import at_points_of, material_of, point_areas
from clothsim.study.reference_solution import Norm
from clothsim.study.study import study_accuracy

SOLVER = {"dt": 0.02, "integrator": "backward_euler", "threads": 1, "linear": "superlu"}
ELASTIC = {"inertia": {}, "membrane": {}, "bending": {"model": "midedge"}, "gravity": {}}
WIND = Scene(
    cloth={"mesh": "rectangle", "size": [0.4, 0.4], "cells": [6, 6], "fabric": "wool", "rotation_degrees": [0, 70, 0]},
    effects={**ELASTIC, "air": {"wind": [0.4, 1.5, 0.0]}, "pins": {"select": "left"}},
    solver=SOLVER,
    run={"duration": 0.24},
)
RAMP = Scene(
    cloth={
        "mesh": "rectangle",
        "size": [0.2, 0.2],
        "cells": [4, 4],
        "rotation_degrees": [0, 20, 0],
        "position": [0.0, 0.0, 1.4e-3],
    },
    body={
        "mesh": "slab",
        "size": [1.2, 0.8, 0.02],
        "rotation_degrees": [0, 20, 0],
        "position": [0.0, 0.0, -0.010642],
    },
    effects={**ELASTIC, "body_contact": {"d_hat": 4e-3}},
    solver=SOLVER,
    run={"duration": 0.16},
)
"""A start at a third of d_hat above a ramp: the barrier pushes the sheet off."""


class InProcess:
    """Runner in this process that begins at most so many runs."""

    def __init__(self, most=10**9):
        self.most = most

    def __call__(self, count, spent):
        return self

    def __enter__(self):
        return self.run

    def __exit__(self, *error):
        pass

    def run(self, jobs, fits, left):
        for job in jobs:
            if self.most <= 0 or not fits(job):
                yield job, None
                continue
            self.most -= 1
            yield job, workers.answer({**asdict(job), "target": str(job.target)})


@pytest.fixture(autouse=True)
def _timed_once(monkeypatch):
    monkeypatch.setattr(workers, "TIMES", 1)


def finest(scene, folder):
    """Positions of a run that shares nothing with a study: BDF2, dt/8, cells x 2, d_hat/4; and its material."""
    scene = paths.replace(paths.replace(scene, "solver.dt", SOLVER["dt"] / 8), "solver.integrator", "bdf2")
    if "body_contact" in scene.effects:
        scene = paths.replace(scene, "effects.body_contact.d_hat", 1e-3)
    return solved(with_cells(paths.replace(scene, "solver.tolerance", 1e-4), Fraction(2)), folder / "finest.npz")


def solved(scene, target):
    found = workers.answer({"scene": scene.to_text(), "target": str(target), "seed": 0})
    assert not found["failed"]
    with np.load(target) as arrays:
        return material_of([arrays["rest_0"]], [arrays["triangles_0"]]), arrays["positions"]


def true_error(scene, folder):
    """RMS distance of a run to the `finest` [mm]."""
    (mesh, positions), (other, there) = solved(scene, folder / "base.npz"), finest(scene, folder)
    areas = point_areas(mesh)
    return 1e3 * Norm(areas / areas.sum())(positions - at_points_of(mesh, other, there))


def test_a_study_that_goes_on_states_an_error_only_after_dt_and_cells(tmp_path):
    """Its sheet vibrates faster than dt follows: backward Euler seems to converge, to 1.2 mm beside the truth."""
    error = true_error(WIND, tmp_path)
    statuses = []
    for _ in range(4):
        result = study_accuracy(WIND, tmp_path, budget=1e6, workers=1, runners=InProcess(4)).result
        ran, headline = {each["label"] for each in result["points"]}, result["headline"]
        statuses.append(headline["status"])
        assert result["chaotic"] in (None, False)
        assert "same material points" in result["measure"]
        if not {"dt +1", "cells +1"} <= ran:
            assert (headline["status"], headline["error"], headline["high"]) == ("unfinished", None, None)
            assert headline["needed_seconds"] > 0
            assert result["recommended"] == []
        elif headline["status"] != "unfinished":
            assert headline["low"] <= error <= 2 * headline["high"]
        if headline["known"]:
            assert error / 2 <= headline["error"] <= 2 * error
    assert statuses[0] == "unfinished"
    assert statuses[-1] == "range"


def test_a_start_inside_d_hat_is_one_push_and_not_several(tmp_path):
    error = true_error(RAMP, tmp_path)
    result = study_accuracy(RAMP, tmp_path, budget=1e6, workers=1, runners=InProcess(20)).result
    headline, adds = result["headline"], sum(parameter["adds"] for parameter in result["parameters"].values())
    assert {"dt", "cells", "d_hat"} <= set(result["together"])
    together = result["reference"]["distance_of_base"]
    assert error / 2 <= together <= 2 * error
    assert abs(together - error) < abs(adds - error)
    assert headline["status"] in ("known", "range")
    assert headline["low"] <= 2 * error
    assert headline["high"] >= error


def test_a_mesh_that_cannot_be_refined_leaves_the_error_open(tmp_path):
    scene = replace(WIND, effects={**WIND.effects, "pins": {"select": [0, 7]}})
    result = study_accuracy(scene, tmp_path, ["dt"], budget=1e6, workers=1, runners=InProcess(8)).result
    headline = result["headline"]
    assert (headline["status"], headline["known"], headline["error"]) == ("partial", False, None)
    assert headline["missing"] == ["cells"]
    assert headline["high"] > headline["low"]
