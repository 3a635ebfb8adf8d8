"""A15, bending run as scenes: a ribbon cut as an arc bends and twists, a cantilever is bent beyond its yield."""

from functools import lru_cache, partial

import numpy as np

from clothsim import Cloth, Scene
from clothsim.mesh.generators.shapes import rectangle
from tests.known_answers.plastic_strip import HARDENING, MESHES, YIELD, tip_of_beam
from tests.known_answers.plastic_strip import WEIGHT as LOAD
from tests.known_answers.row import Outcome, Row
from tests.known_answers.scene_runs import AT_ONCE, ELASTIC, PAPER, WEIGHT, G, ended, on_meshes

RADIUS, SUNK = 0.1, 0.01
"""Of the arc [m]; drop of its tip in radii."""
WIDTHS = 0.05, 0.1, 0.2
"""In radii, extrapolated to none by a parabola: what the clamp adds is proportional to the width."""
ARC = 1.0, 2.0
"""EI and GJ over D b of a ribbon of width b without Poisson's ratio, whose load is rho_A g b a length."""
TO_NONE = 8 / 3, -2.0, 1 / 3
ACROSS = 2, 4, 8
"""Cells across the ribbon, which are as long."""


def arc_drop(bending: float, twisting: float, angle: float = np.pi / 2) -> float:
    """Drop of the tip of a heavy arc that is clamped level at one end, over q R^4; bending, twisting: EI and GJ.

    At the angle t from the tip the moment is q R^2 (1 - cos t) and the torque q R^2 (t - sin t); a load at the tip has
    R sin t and R (1 - cos t) (Castigliano).
    """
    by_moment = (1 - np.cos(angle)) - np.sin(angle) ** 2 / 2
    by_torque = angle**2 / 2 - (angle * np.sin(angle) + np.cos(angle) - 1)
    by_torque += np.cos(angle) - 1 + np.sin(angle) ** 2 / 2
    return float(by_moment / bending + by_torque / twisting)


@lru_cache
def arc_tip(width: float, across: int) -> float:
    """Drop of the tip over rho_A g R^4/D of a quarter of a ring, `width` radii wide, nu = 0."""
    along = round(across * np.pi / 2 / width)
    flat, triangles = rectangle((np.pi / 2, width), (along, across), "alternating")
    angle, radius = flat[:, 0] + np.pi / 4, RADIUS * (1 + flat[:, 1])
    points = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros(len(flat))])
    fraction = SUNK * PAPER["bending_stiffness"] / (arc_drop(*ARC) * WEIGHT * RADIUS**3)
    pins = {"select": np.flatnonzero(angle < 1e-9).tolist(), "clamp": True}
    effects = {**ELASTIC, "gravity": {"acceleration": [0, 0, -fraction * G]}, "pins": pins}
    run = ended(Scene(Cloth(points, triangles, **PAPER), effects=effects, run=AT_ONCE, solver={"dt": 1.0}))
    tip = np.flatnonzero(angle > np.pi / 2 - 1e-9)
    drop = -np.interp(0.0, flat[tip, 1], run.last[tip, 2])
    return float(drop * PAPER["bending_stiffness"] / (fraction * WEIGHT * RADIUS**4))


def _arc() -> Outcome:
    """Order: that of the differences of three meshes at the middle width."""
    exact = arc_drop(*ARC)
    values = [sum(c * arc_tip(width, across) for c, width in zip(TO_NONE, WIDTHS, strict=True)) for across in ACROSS]
    coarse, middle, fine = (arc_tip(WIDTHS[1], across) for across in ACROSS)
    order = float(np.log2((middle - coarse) / (fine - middle)))
    coarser = tuple(value / exact - 1 for value in values[:-1])
    return Outcome(values[-1], exact, 2e-3, order=order, orders=(1.6, 2.5), coarser=coarser)


PULLED, STEPS = 0.1, 10
"""Length of the cantilever [m]; steps of the load, and of its removal."""


@lru_cache
def plastic_tip(cells: int) -> float:
    """How far the tip stays down, over the length, of A3x's cantilever; the pressure that bends it grows and goes."""
    stiffness = PAPER["bending_stiffness"]
    load = LOAD * stiffness / PULLED**3
    cloth = {"mesh": "rectangle", "size": [PULLED, PULLED / 5], "cells": [cells, cells // 5], **PAPER}
    plastic = {"yield_curvature": YIELD / PULLED, "hardening": HARDENING}
    effects = {
        **ELASTIC,
        "plastic_bending": plastic,
        "pressure": {"value": [[0.0, 0.0], [1.0, -load], [2.0, 0.0]]},
        "pins": {"select": "left", "clamp": True},
    }
    run = {"duration": 2.0, "frames_per_second": STEPS}
    found = ended(Scene(cloth=cloth, effects=effects, run=run, solver={"dt": 1 / STEPS}))
    tip = found.positions[0, :, 0] > PULLED / 2 - 1e-9
    return float(-found.last[tip, 2].mean() / PULLED)


ROWS = (
    Row("A15a", "level ribbon, a quarter of a ring, under its weight: drop D/(rho_A g R^4)", _arc),
    Row(
        "A15b",
        "cantilever loaded past its yield in 10 steps, H = 0.5, then unloaded: tip / length",
        partial(on_meshes, plastic_tip, MESHES, tip_of_beam(), 1e-2, (1.6, 6.0)),
    ),
)
