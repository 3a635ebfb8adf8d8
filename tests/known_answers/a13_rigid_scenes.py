"""A13, rigid bodies run as scenes: a block on a slope slides or holds, free cloth catches a ball."""

from functools import lru_cache
from typing import Any

import numpy as np

from clothsim import Scene
from clothsim.base.arrays import Floats
from clothsim.mesh.generators.shapes import rectangle, sphere
from tests.known_answers.row import ANY_ORDER, Outcome, Row
from tests.known_answers.scene_runs import PAPER, Ended, G, ended, on_meshes

FRICTION, GAP, SLIDE = 0.5, 0.0016, 0.5
"""Coefficient; gap at which the block starts, about that at which it rides [m]; duration [s]."""


@lru_cache
def on_slope(tangent: float, steps: int) -> tuple[Floats, Floats]:
    """Times and path down a slope of a block that starts at rest, `steps` a second; tangent: of the slope."""
    angle = float(np.arctan(tangent))
    up, down = np.array([np.sin(angle), 0, np.cos(angle)]), np.array([np.cos(angle), 0, -np.sin(angle)])
    turned = {"rotation_degrees": [0, float(np.degrees(angle)), 0]}
    slope = {"mesh": "slab", "size": [4, 1, 0.1], "position": (-0.05 * up).tolist(), **turned}
    block = {"mesh": "slab", "size": [0.2, 0.2, 0.1], "position": ((0.05 + GAP) * up).tolist(), **turned}
    effects = {"inertia": {}, "gravity": {}, "body_contact": {}, "friction": {"coefficient": FRICTION}}
    run = {"duration": SLIDE, "frames_per_second": steps}
    scene = Scene(
        cloth=(),
        body={"name": "slope", **slope},
        rigid={"name": "block", **block},
        effects=effects,
        solver={"dt": 1 / steps},
        run=run,
    )
    found = ended(scene)
    return found.times, (found.moving.mean(axis=1) - found.moving[0].mean(axis=0)) @ down


def acceleration(tangent: float, steps: int) -> float:
    """Acceleration down the slope [m/s2] over the last three quarters of the run."""
    times, path = on_slope(tangent, steps)
    late = len(times) // 4
    return float(2 * np.polyfit(times[late:], path[late:], 2)[0])


def _sliding() -> Outcome:
    """g (sin - mu cos) at 30 degrees."""
    angle = np.radians(30)
    exact = float(G * (np.sin(angle) - FRICTION * np.cos(angle)))
    return on_meshes(lambda steps: acceleration(float(np.tan(angle)), steps), (50, 100, 200), exact, 3e-3, ANY_ORDER)


def _slip_angle() -> Outcome:
    """Slope at which a block that slides no longer gains speed, from two a little steeper [degrees]."""
    steep = [1.005 * FRICTION, 1.01 * FRICTION]
    first, second = (acceleration(each, 100) for each in steep)
    found = steep[0] - first * (steep[1] - steep[0]) / (second - first)
    return Outcome(float(np.degrees(np.arctan(found))), float(np.degrees(np.arctan(FRICTION))), 1e-3)


def _held() -> Outcome:
    """Path in the last half of the run at .99 of the tangent of that slope."""
    times, path = on_slope(0.99 * FRICTION, 100)
    return Outcome(float(path[-1] - path[len(times) // 2]), 0.0, 1e-7, "m")


BALL_RADIUS, BALL_SPEED, SHEET, CAUGHT, CELLS = 0.05, 1.0, 0.4, 0.2, 8
"""Lengths [m], speed [m/s]; duration [s]; cells of the sheet that falls."""


@lru_cache
def caught(cells: int, rate: int = 100, gravity: bool = False) -> Ended:
    """A sheet that nothing holds catches a ball that flies at it, without weight or with it; rate: steps a second.

    Directions of a Krylov space lost 0.7 % of the momentum on 24 cells, which a stop by the motion does not see.
    """
    ball: dict[str, Any] = {"mesh": "sphere", "radius": BALL_RADIUS, "subdivisions": 2, "density": 100.0}
    ball |= {"name": "ball", "position": [0.01, 0.02, -0.06], "velocity": [0, 0, BALL_SPEED]}
    sheet = {"mesh": "rectangle", "size": [SHEET, SHEET], "cells": [cells, cells], **PAPER}
    effects = {"inertia": {}, "membrane": {}, "bending": {}, "body_contact": {}, "self_contact": {}}
    effects |= {"gravity": {}} if gravity else {}
    run = {"duration": CAUGHT, "frames_per_second": rate}
    return ended(Scene(cloth=sheet, rigid=ball, effects=effects, solver={"dt": 1 / rate}, run=run))


def _centre(run: Ended, cells: int) -> tuple[Floats, float]:
    """Heights of the centre of mass of ball and sheet at the frames [m], and the ball's part of the mass."""
    points, triangles = sphere(BALL_RADIUS, 2)
    ball = 100.0 * float(np.linalg.det(points[triangles]).sum()) / 6
    flat, corners = rectangle((SHEET, SHEET), (cells, cells), "alternating")
    masses = np.bincount(corners.ravel(), minlength=len(flat)) * PAPER["density"] * (SHEET / cells) ** 2 / 6
    total = ball + masses.sum()
    centre = (ball * run.moving.mean(axis=1) + np.einsum("n,knd->kd", masses, run.positions)) / total
    return centre[:, 2], float(ball / total)


def speed_of_both(cells: int) -> float:
    """Speed of the centre of mass of ball and sheet over the last half of the run, over m v/(m + M)."""
    run = caught(cells)
    height, part = _centre(run, cells)
    half = len(run.times) // 2
    return float(np.polyfit(run.times[half:], height[half:], 1)[0]) / (part * BALL_SPEED)


def _caught_with_weight() -> Outcome:
    """Rise of the centre of mass, m v t/(m + M) - g t^2/2, whatever the impact does; the first step has first order."""

    def rise(rate: int) -> float:
        height, _ = _centre(caught(CELLS, rate, gravity=True), CELLS)
        return float(height[-1] - height[0])

    part = _centre(caught(CELLS), CELLS)[1]
    exact = part * BALL_SPEED * CAUGHT - G * CAUGHT**2 / 2
    return on_meshes(rise, (50, 100, 200), exact, 5e-3, (1.7, 2.3))


def _caught() -> Outcome:
    values = [speed_of_both(cells) for cells in (8, 16, 24)]
    return Outcome(values[-1], 1.0, 1e-8, coarser=tuple(value - 1 for value in values[:-1]))


ROWS = (
    Row("A13a", "block sliding on 30 degrees, mu 0.5, 200 steps/s: acceleration [m/s2]", _sliding),
    Row("A13b", "block on a slope, mu 0.5: angle at which it slips [degrees]", _slip_angle),
    Row("A13c", "the same at 0.99 of the tangent of that angle: displacement in the last 0.25 s", _held),
    Row("A13d", "ball caught by free cloth: final speed / (m v/(m + M))", _caught),
    Row("A13e", "the same with gravity: rise of the centre of mass after 0.2 s [m]", _caught_with_weight),
)
