"""Sheets on top of each other under a heavy ball."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from clothsim.run.results import Run
from clothsim.scene.scene import Scene
from tests.hard_cases.case import Case, all_of, energy_falls
from tests.hard_cases.twist import ELASTIC
from tests.hard_cases.where import frames, heights

SHEETS = 10


def stacked(d_hat: float) -> Callable[[bool], Scene]:
    """Ten sheets, d_hat [m] apart, on a fixed plate; a hollow ball of cloth, 50 kg/m2, falls on them."""

    def scene(small: bool) -> Scene:
        n, subdivisions = (4, 1) if small else (10, 2)
        sheet = {"mesh": "rectangle", "size": [0.3, 0.3], "cells": (n, n)}
        sheets = [sheet | {"name": f"sheet {k}", "position": [0, 0, d_hat * (k + 1)]} for k in range(SHEETS)]
        ball = {
            "name": "ball",
            "mesh": "sphere",
            "radius": 0.06,
            "subdivisions": subdivisions,
            "position": [0, 0, 0.065 + d_hat * (SHEETS + 1)],
            "density": 50.0,
            "youngs_modulus": 1e9,
            "bending_stiffness": 1.0,
        }
        return Scene(
            cloth=[*sheets, ball],
            body={"name": "plate", "mesh": "slab", "size": [0.5, 0.5, 0.02], "position": [0, 0, -0.01]},
            effects=ELASTIC
            | {"gravity": {}, "body_contact": {"d_hat": d_hat}, "self_contact": {"d_hat": d_hat}, "friction": {}},
            solver={"dt": 0.01},
            run={"duration": 0.1 if small else 0.15, "frames_per_second": 100},
        )

    return scene


def order_kept(run: Run) -> str:
    """In every frame each sheet, and the ball at last, is above what lies under it, wherever it lies over it."""
    cloths = [surface for surface in run.trajectory.surfaces if surface.role == "cloth"]
    for time, x in zip(run.times, frames(run), strict=True):
        for under, over in pairwise(cloths):
            points = x[over.rows]
            apart = points[:, 2:] - heights(points, x, under.triangles)
            if not np.isnan(apart).all() and np.nanmin(apart) <= 0:
                return f"at {time:.3g} s {over.name} is under {under.name}"
    return ""


CHECK = all_of(order_kept, energy_falls)

CASES = tuple(
    Case(f"B5{letter}", f"ten sheets under a heavy ball, d_hat {d_hat:g} m", stacked(d_hat), CHECK, slow=d_hat < 5e-3)
    for letter, d_hat in zip("abc", (1e-2, 3e-3, 1e-3), strict=True)
)
