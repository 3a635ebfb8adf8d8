"""Infeasible prescribed motion: a body that jumps through cloth, pins driven into one another."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.files.meshes.readers.obj import obj_text
from clothsim.mesh.generators.shapes import sphere
from clothsim.run.results import Run
from clothsim.scene.scene import Scene
from tests.hard_cases.case import Case

ELASTIC: dict[str, dict[str, Any]] = {"inertia": {}, "membrane": {}, "bending": {}}
RADIUS = 0.08


def sheet(small: bool) -> dict[str, Any]:
    """A sheet of .4 m in z = 0."""
    return {"mesh": "rectangle", "size": [0.4, 0.4], "cells": [10, 10] if small else [32, 32]}


def leap(small: bool) -> Mapping[str, str]:
    """Two frames of a ball: half a metre below the sheet, and half a metre above it."""
    ball, triangles = sphere(RADIUS, 2 if small else 3)
    return {f"ball{k}.obj": obj_text(ball + np.array([0, 0, z]), triangles) for k, z in enumerate((-0.5, 0.5))}


def teleported(small: bool, pins: str = "") -> Scene:
    """A ball goes a metre in one step, through where the sheet is."""
    held = {"pins": {"select": pins}} if pins else {}
    return Scene(
        cloth=sheet(small),
        body={"name": "ball", "frames": "ball*.obj", "frames_per_second": 100.0},
        effects=ELASTIC | held | {"gravity": {}, "body_contact": {}, "self_contact": {}},
        solver={"dt": 0.01},
        run={"duration": 0.05, "frames_per_second": 100.0},
    )


def before_the_ball(run: Run) -> str:
    """The ball came from below: the sheet is above it, or at least above where its axis meets the sheet."""
    x = run.positions(-1)
    top = float(run.bodies(-1)[0][1][:, 2].max())
    if x[:, 2].min() > top:
        return ""
    a, b, c = (x[run.triangles[:, k]] for k in range(3))
    parts = np.stack([_twice_area(b, c), _twice_area(c, a), _twice_area(a, b)], axis=1)
    total = parts.sum(axis=1)
    met = (parts * np.sign(total)[:, None] >= 0).all(axis=1) & (total != 0)
    heights = (parts[met] * np.stack([a, b, c], axis=1)[met, :, 2]).sum(axis=1) / total[met]
    if not len(heights):
        return "the sheet is not over the ball"
    return "" if heights.min() > top else f"the sheet is at {heights.min():.3g} m, the ball's top at {top:.3g} m"


def _twice_area(a: Floats, b: Floats) -> Floats:
    """Of the triangles of a, b and the origin, seen along z."""
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], np.float64)


def inside(small: bool) -> Scene:
    """A ball that the sheet cuts in two."""
    return Scene(
        cloth=sheet(small),
        body={"name": "ball", "mesh": "sphere", "radius": RADIUS},
        effects=ELASTIC | {"body_contact": {}},
        run={"duration": 0.1},
    )


def driven_together(small: bool) -> Scene:
    """The two ends of a strip are driven through one another in the strip's own plane."""
    groups = [
        {"select": side, "motion": {"velocity": [sign * 1.0, 0, 0]}} for side, sign in (("left", 1), ("right", -1))
    ]
    return Scene(
        cloth={"mesh": "rectangle", "size": [0.4, 0.1], "cells": [20, 5] if small else [64, 16]},
        effects=ELASTIC | {"self_contact": {}, "pins": {"group": groups}},
        solver={"dt": 0.01},
        run={"duration": 0.5},
    )


CASES = (
    Case("B20a", "ball teleports 1 m through a free sheet", teleported, before_the_ball, files=leap),
    Case(
        "B20b",
        "ball teleports 1 m through a held sheet",
        lambda small: teleported(small, "boundary"),
        before_the_ball,
        files=leap,
    ),
    Case(
        "B20c",
        "ball starts across the sheet: must be refused",
        inside,
        refused=("cloth intersects ball",),
        jitters=False,
    ),
    Case(
        "B21",
        "pinned ends driven into each other: must fail",
        driven_together,
        fails=("prescribed motion", "vertex", "pins.group", "infeasible"),
    ),
)
