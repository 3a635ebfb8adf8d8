"""Values of scene keys: selections of vertices and cloths, and numbers that vary over the cloth and over time."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats, Ints, as_number, as_points
from clothsim.base.errors import InputError
from clothsim.base.inputs import called
from clothsim.keys.schema import FUNCTION
from clothsim.mesh.topology import border_edges, border_vertices, components
from clothsim.mesh.world import World

FLAT = 1e-6
"""Extent along z, over the largest, of a rest shape that is flat."""
NEAR = 0.01
"""Distance of the means of two borders, over the extent of the cloth, below which neither is the farther one."""
SIDES = {"left": (0, -1), "right": (0, 1), "top": (2, 1), "bottom": (2, -1)}
"""Axis and sign of each in space; z is up."""
NAMED = ("corners", *SIDES, "boundary")
TABLES = (
    'It takes { box = [lo, hi] }, { panel = "front" }, { panel = "front", edge = 2 } or { label = "lower_interface" }.'
)


def cloth_number(where: str, world: World, name: object) -> int:
    """Number of the cloth called `name`; None is the only cloth. InputError where that is ambiguous or unknown."""
    names = [cloth.name for cloth in world.cloths]
    if name is None and len(names) == 1:
        return 0
    if name not in names:
        problem = "needs the name of a cloth" if name is None else f"names {name!r}, which is not a cloth"
        raise InputError(f"{where} {problem}.", f"Cloths: {', '.join(names)}.")
    return names.index(str(name))


def selected_vertices(where: str, world: World, select: object) -> Ints:
    """Rows of x selected by a side of every cloth, a box at the start [m], names of a pattern, or vertex numbers.

    Sides of a sheet (flat at rest, or with one border) are those of its rest shape, "top" along y. Of a garment "top"
    is its highest border at the start (a waist, a neck; z is up), "bottom" its lowest (of trousers both hems),
    "left" and "right" along x.
    Tables: { box = [lo, hi] }, { panel = "front" }, { panel = "front", edge = 2 }, { label = "lower_interface" }.
    """
    if not world.n_cloth and not (isinstance(select, list | tuple | np.ndarray) and not len(select)):
        raise InputError(f"{where} selects vertices of cloth, and the scene has none.", "Add a [cloth].")
    if isinstance(select, str):
        if select not in NAMED:
            raise InputError(f"{where} is {select!r}.", f"Known: {', '.join(NAMED)}, [indices], {{ box = [lo, hi] }}.")
        start, parts = world.start(), []
        for cloth, rows in zip(world.cloths, world.cloth_slices, strict=True):
            if not len(cloth.triangles):  # a rod, whose border are its ends
                ends = np.array([rows.start, rows.stop - 1])
                if select in SIDES:  # the one that is farthest to it
                    axis, sign = SIDES[select]
                    ends = ends[:1] if sign * start[ends[0], axis] >= sign * start[ends[1], axis] else ends[1:]
                parts.append(ends)
                continue
            curves = border_curves(cloth.triangles)
            if len(curves) < 2 or is_flat(cloth.rest_positions) or select in ("boundary", "corners"):
                found = _side(select, cloth.rest_positions, cloth.triangles)
            else:
                found = _opening(where, select, cloth.name, start[rows], curves)
            parts.append(found + rows.start)
        return np.concatenate(parts)
    if isinstance(select, Mapping):
        return _select_box(where, world, select) if "box" in select else of_pattern(where, world, select)
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
            f"{where}[{bad[0]}] = {indices[bad[0]]} is not a cloth vertex.",
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


def is_flat(rest: Floats) -> bool:
    """True for a rest shape (n, 3) in a plane z = constant, whose sides lie along x and y."""
    size = np.ptp(rest, axis=0)
    return bool(size[2] <= FLAT * size.max())


def border_curves(triangles: Ints) -> list[Ints]:
    """The connected borders of a mesh, each as its sorted vertices."""
    edges = border_edges(triangles)[0]
    border = np.unique(edges)
    curves = components(edges[:, [0, 1, 1]], int(triangles.max()) + 1)[border]
    return [border[curves == number] for number in np.unique(curves)]


def _opening(where: str, name: str, cloth: str, start: Floats, curves: list[Ints]) -> Ints:
    """Borders of a garment farthest to a side at the start: one, or those level with it, as both hems of trousers.

    Top and bottom are along z, left and right along x.
    """
    axis, sign = SIDES[name]
    along = sign * start[:, axis]
    means = np.array([along[rows].mean() for rows in curves])
    chosen = np.flatnonzero(means >= means.max() - NEAR * np.ptp(along))
    if len(chosen) == len(curves):
        raise InputError(
            f'{where} is "{name}", and no border of {cloth} lies there more than another.',
            f"Name vertices: [indices]. {TABLES}",
        )
    return np.unique(np.concatenate([curves[k] for k in chosen]))


def _select_box(where: str, world: World, select: Mapping[str, Any]) -> Ints:
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


def _side(name: str, rest: Floats, triangles: Ints) -> Ints:
    """A named selection of a sheet: left and right along x, bottom and top along y."""
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


# Values that vary over the cloth and over time.
#
# Over the cloth a scene gives a number; an array with one number for each triangle or for each vertex (averaged over
# the corners; if there are as many triangles as vertices, for the triangles); a table of these by the name of a cloth,
# or of numbers by the name of a panel (a group of the cloth's file), with "other" for the rest. Over time it gives a
# number; key frames [[t0, v0], [t1, v1]], linear between them and constant outside; in Python a function of time. A
# table by cloth may contain key frames.


OTHER = "other"


@dataclass(frozen=True)
class Schedule:
    """A number over time, by key frames or a function.

    Parameters
    ----------
    name : str
        The scene's key, for messages.
    times, values : (k,) arrays
        Key frames [s], k >= 1; empty for a function.
    least : float
        Lower bound of the values.
    function : function of time, optional
        In place of key frames.
    """

    name: str
    times: Floats
    values: Floats
    least: float = -math.inf
    function: Callable[[float], float] | None = None

    def at(self, time: float) -> float:
        """The value at `time` [s]. InputError where the function returns no finite number or one below `least`."""
        if self.function is None:
            return float(np.interp(time, self.times, self.values))
        return _bounded(f"{self.name} at {time:g} s", called(self.name, self.function, time), self.least)

    @property
    def is_constant(self) -> bool:
        """True where the value is the same at all times."""
        return self.function is None and bool((self.values == self.values[0]).all())

    @property
    def is_zero(self) -> bool:
        """True where the value is 0 at all times."""
        return self.is_constant and float(self.values[0]) == 0.0


def schedule(name: str, value: Any, least: float = -math.inf) -> Schedule:
    """The schedule of a scene's value: a number, key frames or a function. InputError names a bad key frame."""
    if callable(value):
        return Schedule(name, np.zeros(0), np.zeros(0), least, value)
    if isinstance(value, Mapping):
        if set(value) == {FUNCTION}:
            raise lost_function(name, value)
        raise InputError(f"{name} must be a number or key frames.")
    if not isinstance(value, list | tuple | np.ndarray) or np.ndim(np.asarray(value, object)) == 0:
        return Schedule(name, np.zeros(1), np.array([_bounded(name, value, least)]), least)
    if not len(value):
        raise InputError(f"{name} has no key frame.", "Give a number, or [[time, value], ...].")
    times, values = np.empty(len(value)), np.empty(len(value))
    for k, frame in enumerate(value):
        if not isinstance(frame, list | tuple | np.ndarray) or len(frame) != 2:
            raise InputError(f"{name}[{k}] is {frame!r}, not a key frame.", "Give [[time, value], ...].")
        times[k] = _bounded(f"{name}[{k}][0]", frame[0], -math.inf)
        values[k] = _bounded(f"{name}[{k}][1]", frame[1], least)
        if k and times[k] <= times[k - 1]:
            raise InputError(f"{name}[{k}] is at {times[k]:g} s, not after {times[k - 1]:g} s.", "Sort them by time.")
    return Schedule(name, times, values, least)


def by_cloth(name: str, value: Any, world: World, least: float = -math.inf) -> tuple[Schedule, ...]:
    """A schedule for each cloth, from one value for all or a table by name. InputError names the invalid key."""
    if isinstance(value, Mapping) and set(value) != {FUNCTION}:
        named = _read_each_cloth(name, value, world)
        return tuple(
            schedule(f"{name}.{cloth.name}", one, least) for cloth, one in zip(world.cloths, named, strict=True)
        )
    return (schedule(name, value, least),) * len(world.cloths)


def over_cloth(name: str, value: Any, world: World, least: float = -math.inf) -> Floats:
    """A number for each triangle of all cloths, (m,). InputError names the cloth and index of an invalid one."""
    if not isinstance(value, Mapping):
        return _over(name, value, world.triangles, world.n_cloth, least)
    panels = {key: one for key, one in value.items() if any(key in cloth.groups for cloth in world.cloths)}
    whole = {key: one for key, one in value.items() if key not in panels}
    if panels and OTHER not in whole and not any(cloth.name in whole for cloth in world.cloths):
        for cloth in world.cloths:
            covered = [cloth.groups[panel] for panel in panels if panel in cloth.groups]
            left = np.setdiff1d(np.arange(len(cloth.triangles)), np.concatenate([np.zeros(0, np.int64), *covered]))
            if len(left):
                raise InputError(
                    f"{name} has no value for {len(left)} triangles of the cloth {cloth.name!r}, such as {left[0]}.",
                    "Add a value for `other`.",
                )
        whole[OTHER] = next(iter(panels.values()))
    named = _read_each_cloth(name, whole, world)
    parts = []
    for cloth, one in zip(world.cloths, named, strict=True):
        numbers = _over(f"{name}.{cloth.name}", one, cloth.triangles, len(cloth.positions), least)
        for panel in panels.keys() & cloth.groups.keys():
            numbers[cloth.groups[panel]] = _bounded(f"{name}.{panel}", panels[panel], least)
        parts.append(numbers)
    return np.concatenate(parts)


def lost_function(name: str, value: Mapping[str, Any]) -> InputError:
    """The error for a run's scene that has the name of a Python function only."""
    return InputError(
        f"{name} was the Python function {value[FUNCTION]!r}, which is not in the scene of the run.",
        "Simulate from the Python program, or give key frames.",
    )


def _read_each_cloth(name: str, table: Mapping[str, Any], world: World) -> list[Any]:
    """The value of each cloth in a table."""
    if set(table) == {FUNCTION}:
        raise lost_function(name, table)
    names = [cloth.name for cloth in world.cloths]
    unknown = next((key for key in table if key not in (*names, OTHER)), None)
    if unknown is not None:
        panels = sorted({panel for cloth in world.cloths for panel in cloth.groups})
        has = f"Cloths: {', '.join(names)}; or other."
        raise InputError(
            f"{name} names {unknown!r}, which is not a cloth.", f"{has} Panels: {', '.join(panels)}." if panels else has
        )
    silent = next((cloth for cloth in names if cloth not in table and OTHER not in table), None)
    if silent is not None:
        raise InputError(f"{name} has no value for the cloth {silent!r}.", "Add one, or a value for `other`.")
    return [table.get(cloth, table.get(OTHER)) for cloth in names]


def _over(name: str, value: Any, triangles: np.ndarray, n_vertices: int, least: float) -> Floats:
    """Values (m,) from a number, an array by triangle or an array by vertex."""
    if callable(value) or isinstance(value, Mapping):
        raise InputError(f"{name} must be a number or an array over the cloth.")
    if not isinstance(value, list | tuple | np.ndarray) or np.ndim(np.asarray(value, object)) == 0:
        return np.full(len(triangles), _bounded(name, value, least))
    try:
        numbers = np.asarray(value, np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} must be numbers: {error}.") from error
    if numbers.shape not in ((len(triangles),), (n_vertices,)):
        shape = f"{len(numbers)} numbers" if numbers.ndim == 1 else f"the shape {numbers.shape}"
        has = f"Give one for each of the {len(triangles)} triangles or of the {n_vertices} vertices."
        raise InputError(f"{name} has {shape}.", has)
    for index in np.flatnonzero(~(np.isfinite(numbers) & (numbers >= least)))[:1]:
        _bounded(f"{name}[{index}]", numbers[index], least)
    return numbers.copy() if len(numbers) == len(triangles) else numbers[triangles].mean(axis=1)


def _bounded(name: str, value: Any, least: float) -> float:
    """`value` as a finite number of at least `least`."""
    number = as_number(name, value)
    if not math.isfinite(number):
        raise InputError(f"{name} is {number}, not a finite number.")
    if number < least:
        raise InputError(f"{name} must be at least {least:g}, not {number:g}.")
    return number
