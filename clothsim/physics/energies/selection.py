"""Selections of scene keys: vertices, and cloths by name."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats, Ints, as_points
from clothsim.base.errors import InputError
from clothsim.mesh.topology import border_vertices
from clothsim.mesh.world import World

NAMED = ("corners", "left", "right", "top", "bottom", "boundary")
TABLES = (
    'It takes { box = [lo, hi] }, { panel = "front" }, { panel = "front", edge = 2 } or { label = "lower_interface" }.'
)


def cloth_number(where: str, world: World, name: object) -> int:
    """Number of the cloth called `name`; None is the only cloth. InputError where that is ambiguous or unknown."""
    names = [cloth.name for cloth in world.cloths]
    if name is None and len(names) == 1:
        return 0
    if name not in names:
        problem = "needs the name of a cloth" if name is None else f"names {name!r}, which is no cloth"
        raise InputError(f"{where} {problem}.", f"Cloths: {', '.join(names)}.")
    return names.index(str(name))


def selected_vertices(where: str, world: World, select: object) -> Ints:
    """Rows of x selected by a side of every cloth, a box at the start [m], names of a pattern, or vertex numbers.

    Tables: { box = [lo, hi] }, { panel = "front" }, { panel = "front", edge = 2 }, { label = "lower_interface" }.
    """
    if isinstance(select, str):
        if select not in NAMED:
            raise InputError(f"{where} is {select!r}.", f"Known: {', '.join(NAMED)}, [indices], {{ box = [lo, hi] }}.")
        parts = [
            _named(select, cloth.rest_positions, cloth.triangles) + rows.start
            for cloth, rows in zip(world.cloths, world.cloth_slices, strict=True)
        ]
        return np.concatenate(parts)
    if isinstance(select, Mapping):
        return _in_box(where, world, select) if "box" in select else of_pattern(where, world, select)
    indices = np.asarray(select)
    if indices.size == 0:
        return np.zeros(0, np.int64)
    return np.unique(vertex_numbers(where, indices, world.n_cloth))


def vertex_numbers(where: str, numbers: Any, n_vertices: int) -> Ints:
    """`numbers` as vertices (k,) of a cloth with `n_vertices`, in their order."""
    indices = np.asarray(numbers)
    if indices.ndim != 1 or not np.issubdtype(indices.dtype, np.integer):
        raise InputError(f"{where} must be vertex numbers, not {numbers!r}.")
    bad = np.flatnonzero((indices < 0) | (indices >= n_vertices))
    if bad.size:
        raise InputError(
            f"{where}[{bad[0]}] = {indices[bad[0]]} is no cloth vertex.",
            f"The cloth has the vertices 0..{n_vertices - 1}.",
        )
    return indices.astype(np.int64)


def of_pattern(where: str, world: World, select: Mapping[str, Any]) -> Ints:
    """Rows of x of a panel, of an edge of it in its order, or of the edges of a label, in every cloth that has it."""
    if set(select) not in ({"panel"}, {"panel", "edge"}, {"label"}):
        raise InputError(f"{where} has the keys {sorted(select)}.", TABLES)
    if "edge" in select and (isinstance(select["edge"], bool) or not isinstance(select["edge"], int | np.integer)):
        raise InputError(f"{where}.edge is {select['edge']!r}.", "Edges of a panel count from 0.")
    found, known = [], set()
    for cloth, rows in zip(world.cloths, world.cloth_slices, strict=True):
        if "label" in select:
            named: Mapping[Any, Ints] = {label: cloth.lines.labelled(label) for label in cloth.lines.labels}
        elif "edge" in select:
            named = cloth.lines.edges
        else:
            named = {name: np.unique(cloth.triangles[faces]) for name, faces in cloth.groups.items()}
        wanted = select["label"] if "label" in select else select["panel"]
        wanted = (wanted, int(select["edge"])) if "edge" in select else wanted
        if isinstance(wanted, str | tuple) and wanted in named:
            found.append(named[wanted] + rows.start)
        known |= {name if isinstance(name, str) else f"{name[0]}.{name[1]}" for name in named}
    if not found:
        names = ", ".join(sorted(known)) or "none: no cloth is of a sewing pattern"
        raise InputError(f"{where} names {dict(select)!r}, which no cloth has.", f"Known: {names}.")
    return np.concatenate(found)


def _in_box(where: str, world: World, select: Mapping[str, Any]) -> Ints:
    if set(select) != {"box"}:
        raise InputError(f"{where} has the keys {sorted(select)}.", TABLES)
    box = as_points(f"{where}.box", select["box"])
    if len(box) != 2:
        raise InputError(f"{where}.box has {len(box)} corners.", "Give two: [lo, hi].")
    low, high = box
    start = world.start()[: world.n_cloth] + world.origin
    selected = np.flatnonzero(((start >= low) & (start <= high)).all(axis=1))
    if not len(selected):
        raise InputError(f"{where}.box contains no cloth vertex.", "Move or enlarge it.")
    return selected


def _named(name: str, rest: Floats, triangles: Ints) -> Ints:
    """A named selection in the rest frame of the mesh: left and right along x, bottom and top along y."""
    border = border_vertices(triangles)
    if name == "boundary":
        return border
    x, y = rest[:, 0], rest[:, 1]
    near = 1e-6 * max(np.ptp(x), np.ptp(y))
    borders = {
        "left": x <= x.min() + near,
        "right": x >= x.max() - near,
        "bottom": y <= y.min() + near,
        "top": y >= y.max() - near,
    }
    if name in borders:
        return np.flatnonzero(borders[name])
    corners = [(a, b) for a in (x.min(), x.max()) for b in (y.min(), y.max())]
    return np.unique([border[np.hypot(x[border] - a, y[border] - b).argmin()] for a, b in corners])
