"""The same scene on a finer or coarser mesh: the cells of its generated cloths multiplied."""

import inspect
from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.errors import InputError
from clothsim.mesh.generate import GENERATORS
from clothsim.mesh.topology import unique_edges
from clothsim.scene.meshes import cloth_shape
from clothsim.scene.scene import Scene

SAME_PLACE = 1e-9
"""Share of the mesh's size within which a vertex is at the place of another."""


def with_cells(scene: Scene, factor: Fraction, nearest: bool = False) -> Scene:
    """`scene` with the cells of every cloth times `factor`; bodies stay as they are.

    Pins that are given by vertex number go to the vertices of the new mesh at the same material places. nearest: cells
    that are no whole numbers are rounded, up to one at least. InputError where a cloth is a file, where cells would be
    no whole numbers, and where pins or a seed file belong to the vertices of one mesh.
    """
    if scene.seed_settings().from_ == "file":
        raise InputError("seed.file gives a place to each vertex of one mesh.", "Leave the cells as they are.")
    cloths = [_scaled(keys, factor, nearest) for keys in scene.cloths]
    finer = replace(scene, cloth=cloths[0] if isinstance(scene.cloth, Mapping) else cloths)
    pins = scene.effects.get("pins")
    if pins is None:
        return finer
    return replace(finer, effects={**scene.effects, "pins": _moved_pins(pins, scene, finer)})


def cells_of(keys: Mapping[str, Any]) -> list[int] | int:
    """The cells of a [cloth] table, its generator's own where it gives none. InputError where it has none."""
    mesh = keys.get("mesh")
    parameters = inspect.signature(GENERATORS[mesh]).parameters if mesh in GENERATORS else {}
    if "cells" not in parameters:
        kind = f"generated {mesh}" if mesh in GENERATORS else "file"
        raise InputError(f"the mesh {mesh!r} is a {kind} without cells", "Only rectangle, disk and tube have cells.")
    cells = keys.get("cells", parameters["cells"].default)
    return list(cells) if isinstance(cells, Sequence) else cells


def _scaled(keys: Mapping[str, Any], factor: Fraction, nearest: bool) -> dict[str, Any]:
    cells = cells_of(keys)
    counts = [count * factor for count in (cells if isinstance(cells, list) else [cells])]
    if not nearest and any(count.denominator != 1 or count < 1 for count in counts):
        raise InputError(f"cells {cells} times {factor} are no whole numbers.", "Choose cells that are powers of two.")
    whole = [max(1, round(count)) for count in counts]
    return {**keys, "cells": whole if isinstance(cells, list) else whole[0]}


def _moved_pins(pins: Mapping[str, Any], old: Scene, new: Scene) -> dict[str, Any]:
    """The keys of [effects.pins] with vertex numbers of the new mesh."""
    moved = {**pins}
    if "select" in pins:
        moved["select"] = _moved_selection(pins["select"], old, new)
    if "group" in pins:
        groups = [{**group, "select": _moved_selection(group.get("select", ()), old, new)} for group in pins["group"]]
        moved["group"] = groups
    return moved


def _moved_selection(select: Any, old: Scene, new: Scene) -> Any:
    """Names and boxes as they are; numbers as those of the vertices of `new` at the same places of the same cloth."""
    if isinstance(select, str | Mapping) or not len(select):
        return select
    before, triangles, first = _rest(old)
    after, _, first_after = _rest(new)
    chosen = np.asarray(select)
    if not np.issubdtype(chosen.dtype, np.integer) or chosen.min() < 0 or chosen.max() >= len(before):
        return select  # refused when the pins are built
    if np.isin(unique_edges(triangles), chosen).all(axis=1).any():
        raise InputError(
            "effects.pins names neighbouring vertices by number, which belong to one mesh.",
            "Select them by name or by { box = [lo, hi] }.",
        )
    cloth = np.searchsorted(first, chosen, side="right") - 1
    return [
        _vertex_at(before[vertex], after, first_after[k], first_after[k + 1])
        for vertex, k in zip(chosen, cloth, strict=True)
    ]


def _vertex_at(place: Floats, rest: Floats, low: int, high: int) -> int:
    """The vertex of rest[low:high] at `place`."""
    distances = np.linalg.norm(rest[low:high] - place, axis=1)
    found = int(distances.argmin())
    if distances[found] > SAME_PLACE * float(np.ptp(rest[low:high], axis=0).max()):
        raise InputError(
            "effects.pins names a vertex by number, and the other mesh has none at its place.",
            "Select it by name or by { box = [lo, hi] }.",
        )
    return low + found


def _rest(scene: Scene) -> tuple[Floats, Ints, Ints]:
    """Rest positions of all cloths as generated (n, 3), triangles (m, 3), the first vertex of each and the end."""
    shapes = [cloth_shape(keys, f"cloth[{k}]", scene.directory) for k, keys in enumerate(scene.cloths)]
    first = np.cumsum([0, *(len(shape.positions) for shape in shapes)])
    triangles = [shape.triangles + start for shape, start in zip(shapes, first[:-1], strict=True)]
    return np.concatenate([shape.positions for shape in shapes]), np.concatenate(triangles), first
