"""Refinement of a scene: the cells of its generated cloths multiplied."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.keys.mesh_keys import ClothTable
from clothsim.mesh.generators.table import GENERATORS
from clothsim.mesh.topology import unique_edges
from clothsim.scene.assembly.meshes import cloth_shape
from clothsim.scene.scene import Scene

SAME_POSITION = 1e-9
"""Fraction of the mesh's size within which two vertices coincide."""
SELECTING = {"pins": "group", "springs": "spring"}
"""Effects that select vertices, and the key of their list of tables."""


def with_cells(scene: Scene, factor: Fraction, nearest: bool = False) -> Scene:
    """A scene with the cells of every cloth multiplied; bodies stay as they are.

    Parameters
    ----------
    scene : Scene
        Scene to change; it stays as it is.
    factor : Fraction
        Factor of the cells.
    nearest : bool
        True: cells that are not whole numbers are rounded, to one at least.

    Returns
    -------
    Scene
        Pins and springs by vertex number are at the vertices of the new mesh with the same material points.

    Raises
    ------
    InputError
        For a cloth of a file, for cells that are not whole numbers, and where pins, springs, seams, creases, an array
        over the cloth or a seed file belong to the vertices or triangles of one mesh.

    Examples
    --------
    >>> import clothsim
    >>> scene = clothsim.Scene(cloth={"mesh": "rectangle", "cells": [8, 8]})
    >>> with_cells(scene, Fraction(1, 2)).cloth["cells"]
    (4, 4)
    """
    if scene.seed_settings.from_ == "file":
        raise InputError("seed.file has a position for each vertex of one mesh.", "Leave the cells as they are.")
    # a line of vertex numbers is of one mesh: another has more or fewer vertices along it
    seams = scene.effects["seams"].seam if "seams" in scene.effects else ()
    creases = scene.effects["rest_angle"].crease if "rest_angle" in scene.effects else ()
    lines = [(f"effects.seams.seam[{k}].from", seam.from_) for k, seam in enumerate(seams)]
    lines += [(f"effects.seams.seam[{k}].to", seam.to) for k, seam in enumerate(seams)]
    lines += [(f"effects.rest_angle.crease[{k}]", crease) for k, crease in enumerate(creases)]
    for name, line in lines:
        if "vertices" in line.given:
            raise InputError(f"{name}.vertices are those of one mesh.", "Give the line by `through`.")
    _refuse_arrays("effects", scene.effects)
    cloths = [_scaled(keys, factor, nearest) for keys in scene.cloths]
    finer = replace(scene, cloth=cloths[0] if isinstance(scene.cloth, Mapping) else cloths)
    moved = {
        name: _renumber_keys(f"effects.{name}", scene.effects[name], tables, scene, finer)
        for name, tables in SELECTING.items()
        if name in scene.effects
    }
    return replace(finer, effects={**scene.effects, **moved})


def cells_of(keys: ClothTable) -> list[int] | int:
    """The cells of a cloth. InputError for a mesh without cells."""
    cells, mesh = getattr(keys, "cells", None), keys.mesh
    if cells is None:
        kind = f"generated {mesh}" if mesh in GENERATORS else "file" if isinstance(mesh, str) else "mesh in memory"
        raise InputError(f"The mesh {mesh!r} is a {kind} without cells.", "Only rectangle, disk and tube have cells.")
    return list(cells) if isinstance(cells, Sequence) else cells


def _scaled(keys: ClothTable, factor: Fraction, nearest: bool) -> dict[str, Any]:
    cells = cells_of(keys)
    counts = [count * factor for count in (cells if isinstance(cells, list | tuple) else [cells])]
    if not nearest and any(count.denominator != 1 or count < 1 for count in counts):
        raise InputError(f"cells {cells} times {factor} are not whole numbers.", "Choose cells that are powers of two.")
    whole = [max(1, round(count)) for count in counts]
    return {**keys, "cells": whole if isinstance(cells, list | tuple) else whole[0]}


def _refuse_arrays(where: str, keys: Mapping[str, Any]) -> None:
    """InputError for values by triangle or vertex, as an array or in a file: another mesh has more or fewer."""
    for key, value in keys.items():
        name = f"{where}.{key}"
        if key == "select":  # vertices, which are found again on the other mesh
            continue
        if isinstance(value, Mapping):
            _refuse_arrays(name, value)
        elif (isinstance(value, np.ndarray) and value.size > 3) or (isinstance(value, str) and value.endswith(".npy")):
            raise InputError(f"{name} has values for one mesh.", "Give a number, or a table by cloth.")


def _renumber_keys(where: str, keys: Mapping[str, Any], tables: str, old: Scene, new: Scene) -> dict[str, Any]:
    """The keys of an effect, and of its list of `tables`, with vertex numbers of the new mesh in each select."""
    moved = {**keys}
    if "select" in keys:
        moved["select"] = _renumber_selection(where, keys["select"], old, new)
    if tables in keys:
        moved[tables] = [
            _renumber_keys(f"{where}.{tables}[{k}]", table, "", old, new) for k, table in enumerate(keys[tables])
        ]
    return moved


def _renumber_selection(where: str, select: Any, old: Scene, new: Scene) -> Any:
    """Names and boxes as they are; numbers as those of the vertices of `new` at the same points of the same cloth."""
    if isinstance(select, str | Mapping) or not np.size(select):
        return select
    before, triangles, first = _rest(old)
    after, _, first_after = _rest(new)
    chosen = np.asarray(select)
    whole = chosen.ndim == 1 and np.issubdtype(chosen.dtype, np.integer)
    if not whole or chosen.min() < 0 or chosen.max() >= len(before):
        return select  # refused when the effect is built
    if np.isin(unique_edges(triangles), chosen).all(axis=1).any():
        raise InputError(
            f"{where} names neighbouring vertices by number, which belong to one mesh.",
            "Select them by name or by { box = [lo, hi] }.",
        )
    cloth = np.searchsorted(first, chosen, side="right") - 1
    return [
        _vertex_at(where, before[vertex], after, first_after[k], first_after[k + 1])
        for vertex, k in zip(chosen, cloth, strict=True)
    ]


def _vertex_at(where: str, point: Floats, rest: Floats, low: int, high: int) -> int:
    """The vertex of rest[low:high] at `point`."""
    distances = np.linalg.norm(rest[low:high] - point, axis=1)
    nearest = int(distances.argmin())
    if distances[nearest] > SAME_POSITION * float(np.ptp(rest[low:high], axis=0).max()):
        raise InputError(
            f"{where} names a vertex by number, and the other mesh has none at its point.",
            "Select it by name or by { box = [lo, hi] }.",
        )
    return low + nearest


def _rest(scene: Scene) -> tuple[Floats, Ints, Ints]:
    """Rest positions of all cloths as generated (n, 3), triangles (m, 3), the first vertex of each and the end."""
    shapes = [cloth_shape(keys, f"cloth[{k}]", scene.directory) for k, keys in enumerate(scene.cloths)]
    first = np.cumsum([0, *(len(shape.positions) for shape in shapes)])
    triangles = [shape.triangles + start for shape, start in zip(shapes, first[:-1], strict=True)]
    return np.concatenate([shape.positions for shape in shapes]), np.concatenate(triangles), first
