"""A11, strips and rings run as scenes: heart loop, strip lifted off a table, pinched ring, hanging chain."""

from collections.abc import Mapping
from functools import lru_cache, partial
from typing import Any

import numpy as np

from clothsim import Cloth, Scene
from clothsim.base.arrays import Floats
from clothsim.mesh.generators.shapes import rectangle
from tests.known_answers.loops import depth_of_heart, lifted_strip, pinched_ring
from tests.known_answers.row import ANY_ORDER, Outcome, Row
from tests.known_answers.scene_runs import AT_ONCE, ELASTIC, PAPER, WEIGHT, Ended, G, ended, on_meshes

ACROSS = 10
"""Cells along a strip for one across it."""
SECOND = (1.7, 2.5)
"""Orders of convergence that pass where it is to be 2."""
LOOP, GAP = 0.2, 0.01
"""Length of the heart loop [m]; distance of its ends over it."""
HIGH = 1.0
"""Height to which a strip is lifted, over (B/q)^(1/3)."""
RADIUS, PRESSED = 0.05, 0.75
"""Of the ring [m]; its height over its diameter once it is pinched."""


# --- the heart loop -------------------------------------------------------------------------------------------------


def loop_start(cells: int) -> Floats:
    """Points (cells + 1, 2) of a loop of length LOOP whose end edges are upright and whose halves mirror each other."""
    from scipy.optimize import brentq

    half, edge = cells // 2, LOOP / cells

    def path(power: float) -> Floats:
        turned = np.clip((np.arange(half) - 0.5) / (half - 1), 0, 1) ** power
        angles = np.pi / 2 - 1.5 * np.pi * turned
        steps = edge * np.column_stack([np.cos(angles), np.sin(angles)])
        return np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)]) + np.array([GAP * LOOP / 2, 0.0])

    right = path(brentq(lambda power: path(power)[-1, 0], 0.2, 1.0))
    return np.concatenate([right, right[-2::-1] * [-1, 1]])


def heart_scene(weight: float, cells: int, dt: float | None = None) -> tuple[Scene, Floats]:
    """A heart loop of q L^3/B = weight, and the vertices at its bottom."""
    flat, triangles = rectangle((LOOP, 2 * LOOP / ACROSS), (cells, 2 * cells // ACROSS), "alternating")
    along = np.rint((flat[:, 0] / LOOP + 0.5) * cells).astype(int)
    start = loop_start(cells)[along]
    paper = {**PAPER, "bending_stiffness": WEIGHT * LOOP**3 / weight}
    cloth = Cloth(np.column_stack([start[:, 0], flat[:, 1], start[:, 1]]), triangles, rest=flat[:, :2], **paper)
    ends = [{"select": np.flatnonzero(along == end).tolist(), "clamp": True} for end in (0, cells)]
    effects = {**ELASTIC, "gravity": {}, "pins": {"group": ends}}
    scene = Scene(cloth=cloth, effects=effects, run=AT_ONCE, solver={} if dt is None else {"dt": dt})
    return scene, np.flatnonzero(along == cells // 2)


def loop_depth(weight: float, cells: int, dt: float | None = None) -> float:
    """Depth of the loop at rest, over its length."""
    scene, bottom = heart_scene(weight, cells, dt)
    return float(-ended(scene).last[bottom, 2].mean() / LOOP)


def _heart(weight: float) -> Outcome:
    return on_meshes(partial(loop_depth, weight), (20, 40, 80), depth_of_heart(weight, GAP), 2e-3, SECOND)


# --- the strip that is lifted off a table ---------------------------------------------------------------------------

SCALE = float((PAPER["bending_stiffness"] / WEIGHT) ** (1 / 3))
"""(B/q)^(1/3) of PAPER [m]."""
LYING = 5.0
"""Length of the strip over SCALE."""


@lru_cache
def lifted(cells: int) -> Ended:
    """A strip on a smooth table whose right edge has been lifted by HIGH; d_hat is the default, .1 of the edges."""
    width, gap = 2 * LYING / ACROSS * SCALE, 0.1 * LYING / cells * SCALE
    size, count = [LYING * SCALE, width], [cells, 2 * cells // ACROSS]
    strip = {"mesh": "rectangle", "size": size, "cells": count, "position": [0, 0, gap], **PAPER}
    table = {"name": "table", "mesh": "slab", "size": [1, 0.4, 0.02], "position": [0, 0, -0.01]}
    lift = {"select": "right", "motion": {"velocity": [0, 0, HIGH * SCALE]}}
    effects = {**ELASTIC, "gravity": {}, "body_contact": {}, "pins": lift}
    return ended(Scene(cloth=strip, body=table, effects=effects, run=AT_ONCE))


def _edge_force() -> Outcome:
    """Force at the edge over q (B/q)^(1/3), a width of 1. The errors of cells and d_hat have opposite signs."""
    strip = lifted_strip(HIGH)
    exact = float(strip.unknowns.sum())
    width = 2 * LYING / ACROSS * SCALE

    def force(cells: int) -> float:
        return float(lifted(cells).pins["pins"][2] / (WEIGHT * width * SCALE))

    return on_meshes(force, (20, 40, 80), exact, 5e-3, ANY_ORDER)


def _lifted_length() -> Outcome:
    """Arc length of the part that is more than HIGH/10 above the part that lies."""
    strip = lifted_strip(HIGH)
    exact = float(strip.s[-1] - strip.where(0.1 * HIGH))

    def length(cells: int) -> float:
        run = lifted(cells)
        rest = run.positions[0]
        middle = np.flatnonzero(np.abs(rest[:, 1]) < 1e-9)
        middle = middle[np.argsort(rest[middle, 0])]
        x = run.last[middle][:, [0, 2]] / SCALE
        s = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(x, axis=0), axis=1))])
        return float(s[-1] - np.interp(x[:, 1].min() + 0.1 * HIGH, x[:, 1], s))

    return on_meshes(length, (20, 40, 80), exact, 5e-3, (0.7, 2.5))


# --- the pinched ring -----------------------------------------------------------------------------------------------


@lru_cache
def pinched(cells: int) -> Ended:
    """A ring of `cells` about, held along a line, whose opposite line is pressed towards it."""
    small = 1e-6
    lines = [{"box": [[-small, y - small, -1], [small, y + small, 1]]} for y in (-RADIUS, RADIUS)]
    pressed = {"velocity": [0, -2 * (1 - PRESSED) * RADIUS, 0]}
    groups = [{"select": lines[0]}, {"select": lines[1], "motion": pressed}]
    ring: dict[str, Any] = {"mesh": "tube", "radius": RADIUS, "height": 0.02, "cells": [cells, cells // 16], **PAPER}
    return ended(Scene(cloth=ring, effects={**ELASTIC, "pins": {"group": groups}}, run=AT_ONCE))


def _pinching_force() -> Outcome:
    def force(cells: int) -> float:
        load = -pinched(cells).pins["pins.group[1]"][1] / 0.02
        return float(load * RADIUS**2 / PAPER["bending_stiffness"])

    return on_meshes(force, (32, 64, 128), pinched_ring(PRESSED)[0], 5e-3, SECOND)


def _pinched_width() -> Outcome:
    def width(cells: int) -> float:
        return float(np.ptp(pinched(cells).last[:, 0]) / (2 * RADIUS))

    return on_meshes(width, (32, 64, 128), pinched_ring(PRESSED)[1], 5e-3, SECOND)


# --- the hanging chain ----------------------------------------------------------------------------------------------

HANGING, SWING = 0.5, 0.002
"""Length of a strip that hangs from its upper edge [m]; amplitude of its tip over the length."""
CHAIN: Mapping[str, Any] = {**PAPER, "bending_stiffness": 1e-9}


def period_of_chain(mode: int, cells: int) -> float:
    """Period of a mode over that of the chain, from two zeros of its amplitude; 2.5 `cells` steps a period.

    The strip starts at rest in the shape J0(j sqrt(1 - s/L)) of the mode, stretched by its weight.
    """
    from scipy.special import j0, jn_zeros

    flat, triangles = rectangle((2 * HANGING / cells, HANGING), (2, cells), "alternating")
    s, zero = HANGING / 2 - flat[:, 1], jn_zeros(0, mode)[-1]
    shape = j0(zero * np.sqrt(np.clip(1 - s / HANGING, 0, 1)))
    drop = s + WEIGHT / (CHAIN["youngs_modulus"] * CHAIN["thickness"]) * (HANGING * s - s**2 / 2)
    start = np.column_stack([flat[:, 0], SWING * HANGING * shape, -drop])
    period = float(4 * np.pi / zero * np.sqrt(HANGING / G))
    dt = period / (2.5 * cells)
    scene = Scene(
        cloth=Cloth(start, triangles, rest=flat[:, :2], **CHAIN),
        effects={"membrane": {}, "gravity": {}, "inertia": {}, "pins": {"select": np.flatnonzero(s < 1e-9).tolist()}},
        solver={"dt": dt},
        run={"duration": 0.9 * period, "frames_per_second": 1 / dt},
    )
    run = ended(scene)
    found = run.positions[:, :, 1] @ shape
    before = np.flatnonzero(found[:-1] * found[1:] < 0)
    ratio = found[before] / (found[before] - found[before + 1])
    first, second = (run.times[before] + ratio * dt)[:2]
    return float(2 * (second - first) / period)


def _chain(mode: int, bar: float) -> Outcome:
    """Over the frequency j_0n/2 sqrt(g/L) of Bernoulli's chain."""
    return on_meshes(lambda cells: 1 / period_of_chain(mode, cells), (20, 40, 80), 1.0, bar, SECOND)


ROWS = (
    Row("A11a", "heart loop, q L^3/B = 50: depth / length", partial(_heart, 50.0)),
    Row("A11b", "heart loop, q L^3/B = 200: depth / length", partial(_heart, 200.0)),
    Row("A11c", "strip lifted off a table by (B/q)^(1/3): force at its edge / (q (B/q)^(1/3))", _edge_force),
    Row("A11d", "the same: length lifted above a tenth of the height / (B/q)^(1/3)", _lifted_length),
    Row("A11e", "ring pinched to 0.75 of its diameter: force R^2/B", _pinching_force),
    Row("A11f", "the same: width / diameter", _pinched_width),
    Row("A11g", "hanging chain, 200 steps per period, mode 1: omega / (j_01/2 sqrt(g/L))", partial(_chain, 1, 1e-3)),
    Row("A11h", "the same, mode 2: omega / (j_02/2 sqrt(g/L))", partial(_chain, 2, 2e-3)),
    Row("A11i", "the same, mode 3: omega / (j_03/2 sqrt(g/L))", partial(_chain, 3, 5e-3)),
)
