"""Balance of Newton's error against the time error, over a whole drape on a ball and a card that starts to slip."""

import numpy as np
import pytest
from small_scenes import small_scene

from clothsim import simulate

PAPER = {"density": 0.12, "thickness": 2e-4, "youngs_modulus": 2e6, "poisson_ratio": 0.3, "bending_stiffness": 2e-4}
ELASTIC = {"inertia": {}, "membrane": {}, "bending": {"model": "hinge"}, "gravity": {}}


def drape():
    """A sheet as stiff as paper that lies down over a ball, off its centre: one solution."""
    return {
        "cloth": {"mesh": "rectangle", "size": [0.24, 0.24], "cells": [6, 6], **PAPER},
        "body": {
            "name": "ball",
            "mesh": "sphere",
            "radius": 0.08,
            "position": [0.01, 0.02, -0.0825],
            "subdivisions": 2,
        },
        "effects": {**ELASTIC, "damping": {"rate": 4.0}, "body_contact": {"d_hat": 2e-3}},
        "run": {"duration": 0.12, "frames_per_second": 25},
    }


def ramp():
    """A card inside d_hat of a ramp, held by friction for the first steps of a solve."""
    start = {"rotation_degrees": [0, 25, 0], "position": [0.0046, 0.0, 0.0099]}
    return {
        "cloth": {"mesh": "rectangle", "size": [0.2, 0.1], "cells": [4, 2], **PAPER, **start},
        "body": {"name": "ramp", "mesh": "slab", "size": [1.0, 0.4, 0.02], "rotation_degrees": [0, 25, 0]},
        "effects": {**ELASTIC, "body_contact": {"d_hat": 2e-3}, "friction": {"coefficient": 0.2}},
        "run": {"duration": 0.12, "frames_per_second": 25},
    }


def end_of(sections, folder, **solver):
    given = {"dt": 0.01, "threads": 1, "linear": "superlu", "integrator": "backward_euler", **solver}
    run = simulate(small_scene(**sections, solver=given), folder)
    assert run.status == "completed"
    return run.positions(-1), run.summary["newton_iterations"]


def distance(one, other):
    return float(np.sqrt(((one - other) ** 2).sum(axis=1).mean()))


@pytest.mark.parametrize(("stop", "most_of_dt"), [({}, 0.2), ({"converge": True}, 0.1)])
@pytest.mark.parametrize("sections", [drape, ramp])
def test_the_accumulated_error_stays_well_below_that_of_dt(tmp_path, sections, stop, most_of_dt):
    tight, most = end_of(sections(), tmp_path / "tight", tolerance=1e-6)
    half, _ = end_of(sections(), tmp_path / "half", tolerance=1e-5, dt=0.005)
    balanced, iterations = end_of(sections(), tmp_path / "balanced", **stop)
    assert iterations < 0.9 * most
    assert distance(half, tight) > 1e-5
    assert distance(balanced, tight) < most_of_dt * distance(half, tight)


def test_a_scene_of_ten_times_the_size_takes_the_same_iterations(tmp_path):
    """Lengths by 10, times and speeds by 10^1/2, stiffness as weight over length asks: no constant has a unit."""
    sections, factor = drape(), 10.0
    duration = factor**0.5
    cloth, body = dict(sections["cloth"]), dict(sections["body"])
    cloth |= {"size": [2.4, 2.4], "thickness": 2e-3, "bending_stiffness": 0.2}
    body |= {"radius": 0.8, "position": [0.1, 0.2, -0.825]}
    effects = sections["effects"] | {"damping": {"rate": 4.0 / duration}, "body_contact": {"d_hat": 2e-2}}
    run = {"duration": 0.12 * duration, "frames_per_second": 25 / duration}
    large = {"cloth": cloth, "body": body, "effects": effects, "run": run}
    one, few = end_of(sections, tmp_path / "small")
    other, many = end_of(large, tmp_path / "large", dt=0.01 * duration)
    assert few == many
    assert np.abs(other / factor - one).max() < 1e-6
