"""Pattern files: `specification.json` of GarmentCode, Garment-Pattern-Generator, SewFormer and NeuralTailor."""

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.base.file_reading import Budget
from clothsim.patterns.curves import Arc, Bezier, Curve, Polyline, Straight, along_chord
from clothsim.patterns.pattern import Panel, Pattern, PatternEdge, Side, Stitch

USUAL_UNITS = 100.0
"""Units of a file in a metre where it names none."""
SMALLEST_UNITS, LARGEST_UNITS = 0.01, 1e6
ORDERS = ("zyx", "xyz")
POINTS_OF = {"quadratic": 1, "cubic": 2, "polyline": -1}
"""Points between the ends of a curve by its type; -1: any number. "polyline" is this reader's own."""
NAMED = 6
"""Panels that a note names."""
ALIKE = np.radians(1.0)
"""Angle between the rotations of both orders below which they are not told apart [rad]."""
LARGEST = 16 * 2**20
"""Largest file that is read [bytes]."""
DEEPEST = 64
"""Deepest nesting of lists and tables that is read."""


def read_specification(path: str | Path, rotation_order: str = "zyx") -> Pattern:
    """Read a sewing pattern.

    Parameters
    ----------
    path : str or Path
        A JSON file with `pattern.panels`, `pattern.stitches` and `properties`.
    rotation_order : str
        "zyx": a panel is turned by R = Rz Ry Rx of its angles, as every reader does; "xyz": by Rx Ry Rz, which
        GarmentCode writes from version 2.0 on.

    Returns
    -------
    Pattern
        In metres and radians.

    Raises
    ------
    InputError
        For a file that is not a pattern; the message names the panel, edge or stitch.

    Examples
    --------
    >>> from clothsim.patterns.specification import read_specification
    >>> read_specification("shirt_specification.json").stitches  # doctest: +SKIP
    """
    file = Path(path)
    if not file.is_file():
        raise InputError(f"{file} is not a file.", "Give the specification.json of a sewing pattern.")
    if file.stat().st_size > LARGEST:
        raise InputError(
            f"{file} has {file.stat().st_size >> 20} MiB: no sewing pattern is larger than {LARGEST >> 20} MiB."
        )
    try:
        entries = json.loads(file.read_text(encoding="utf-8-sig"), object_pairs_hook=_without_duplicates)
    except (ValueError, RecursionError) as error:
        how = "Give the specification.json of a sewing pattern, and the body with --on."
        raise InputError(f"{file} is not JSON: {error}.", how) from error
    except OSError as error:
        raise InputError(f"{file} cannot be read: {error.strerror}.") from error
    try:
        return pattern_of(entries, rotation_order)
    except InputError as error:
        raise InputError(f"{file.name}: {error.sentence}", error.remedy) from error


def pattern_of(entries: Any, rotation_order: str = "zyx") -> Pattern:
    """Pattern of the entries of a specification, as `json.load` gives them. InputError as `read_specification`."""
    if rotation_order not in ORDERS:
        raise InputError(f"rotation_order is {rotation_order!r}.", f"Known: {', '.join(ORDERS)}.")
    pattern = _table("The file", _table("The file", entries).get("pattern"), "pattern")
    level = [entries]
    for _ in range(DEEPEST):
        inside = [each.values() if isinstance(each, Mapping) else each for each in level]
        level = [value for each in inside for value in each if isinstance(value, Mapping | list)]
    if level:  # it could not be written again
        raise InputError(f"The file nests lists and tables deeper than {DEEPEST}.", "No sewing pattern does.")
    properties = _table("The file", _given(entries, "properties", {}), "properties")
    given = "units_in_meter" in properties
    notes: tuple[str, ...] = () if given else ("the file names no units_in_meter: its lengths are read as centimetres",)
    units = float(_numbers("properties.units_in_meter", [properties.get("units_in_meter", USUAL_UNITS)], (1,))[0])
    if not SMALLEST_UNITS <= units <= LARGEST_UNITS:
        raise InputError(f"properties.units_in_meter is {units:g}.", "100 for centimetres, 1 for metres.")
    unit = 1 / units
    absolute = properties.get("curvature_coords", "relative") == "absolute"
    raw = {
        _name(name): _table(f"Panel {name}", panel)
        for name, panel in _table("The pattern", pattern.get("panels"), "panels").items()
    }
    _count(raw, _given(pattern, "stitches", []))
    rotations = {
        name: np.radians(_numbers(f"Panel {name}: rotation", _given(panel, "rotation", [0, 0, 0]), (3,)))
        for name, panel in raw.items()
    }
    panels = {
        name: _panel(name, panel, unit, absolute, _angles(rotations[name], rotation_order))
        for name, panel in raw.items()
    }
    stitches = _given(pattern, "stitches", [])
    if not isinstance(stitches, Sequence) or isinstance(stitches, str):
        raise InputError("pattern.stitches is not a list.", "Give a list of pairs of sides.")
    sewn = tuple(_stitch(number, stitch) for number, stitch in enumerate(stitches))
    zyx, xyz = ({name: _rotation(angles, order) for name, angles in rotations.items()} for order in ORDERS)
    found = [name for name in rotations if (zyx[name].inv() * xyz[name]).magnitude() > ALIKE]
    names = ", ".join(found[:NAMED]) + (f" and {len(found) - NAMED} more" if len(found) > NAMED else "")
    notes += (f"rotation_order is {rotation_order}; the other order turns {names} differently",) if found else ()
    other = {key: value for key, value in entries.items() if key not in ("pattern", "properties")}
    kept = {key: value for key, value in pattern.items() if key not in ("panels", "stitches")}
    source = {"file": other, "pattern": kept, "properties": dict(properties)}
    return Pattern(panels, sewn, notes, source)


def _name(name: Any) -> str:
    """The name of a panel, which reports print as it is. InputError if it would steer a terminal."""
    if not str(name).isprintable():
        raise InputError(f"The panel {str(name)!r} has control characters in its name.", "Name it in letters.")
    return str(name)


def _count(panels: Mapping[str, Mapping[str, Any]], stitches: Any) -> None:
    """InputError for more panels, edges, points or stitches than are read."""
    budget = Budget("The pattern")
    budget.spend("panels", len(panels))
    budget.spend("stitches", len(stitches) if isinstance(stitches, list) else 0)
    for name, panel in panels.items():
        edges = panel.get("edges")
        edges = edges if isinstance(edges, list) else []
        curves = [edge.get("curvature") if isinstance(edge, Mapping) else None for edge in edges]
        inner = [curve.get("params") if isinstance(curve, Mapping) else None for curve in curves]
        own = Budget(f"Panel {name}")
        for points in (panel.get("vertices"), *inner):
            own.spend("points of a panel", len(points) if isinstance(points, list) else 0)
        budget.spend("edges", len(edges))


def write_specification(path: str | Path, pattern: Pattern) -> None:
    """Write a pattern as a specification with relative control points in the units of its file (else cm)."""
    Path(path).write_text(json.dumps(entries_of(pattern), indent=2) + "\n", encoding="utf-8")


def entries_of(pattern: Pattern) -> dict[str, Any]:
    """Entries of the specification of a pattern."""
    properties = {**pattern.source.get("properties", {}), "curvature_coords": "relative"}
    units = float(properties.setdefault("units_in_meter", USUAL_UNITS))
    stitches: list[list[Any]] = []
    for stitch in pattern.stitches:
        sides: list[Any] = [{"panel": side.panel, "edge": side.edge} for side in stitch.sides]
        stitches.append([*sides, "right_wrong"] if stitch.right_wrong else sides)
    panels = {
        name: {
            "translation": (units * panel.translation).tolist(),
            "rotation": np.degrees(panel.rotation).tolist(),
            "vertices": (units * panel.vertices).tolist(),
            "edges": [_edge_entries(edge, units) for edge in panel.edges],
            **({"label": panel.label} if panel.label else {}),
        }
        for name, panel in pattern.panels.items()
    }
    body = {**pattern.source.get("pattern", {}), "panels": panels, "stitches": stitches}
    return {**pattern.source.get("file", {}), "pattern": body, "properties": properties}


def _rotation(angles: Floats, order: str) -> Rotation:
    """Rz Ry Rx ("zyx") or Rx Ry Rz ("xyz") of the angles about x, y and z [rad]."""
    return Rotation.from_euler("xyz", angles) if order == "zyx" else Rotation.from_euler("zyx", angles[::-1])


def _angles(angles: Floats, order: str) -> Floats:
    """The angles of R = Rz Ry Rx that turn as `angles` do in the `order` [rad]."""
    return angles if order == "zyx" else np.asarray(_rotation(angles, order).as_euler("xyz"), np.float64)


def _panel(name: str, entries: Mapping[str, Any], unit: float, absolute: bool, rotation: Floats) -> Panel:
    where = f"Panel {name}"
    vertices = unit * _numbers(f"{where}: vertices", entries.get("vertices"), (-1, 2))
    edges = entries.get("edges")
    if not isinstance(edges, list):
        raise InputError(f"{where} has no list of edges.")
    translation = unit * _numbers(f"{where}: translation", _given(entries, "translation", [0, 0, 0]), (3,))
    made = tuple(_edge(name, number, edge, vertices, unit, absolute) for number, edge in enumerate(edges))
    return Panel(name, vertices, made, translation, rotation, _label(where, entries))


def _edge(name: str, number: int, entries: Any, vertices: Floats, unit: float, absolute: bool) -> PatternEdge:
    where = f"Edge {number} of panel {name}"
    edge = _table(where, entries)
    ends = edge.get("endpoints")
    if not (isinstance(ends, list) and len(ends) == 2 and all(type(end) is int for end in ends)):
        raise InputError(f"{where} has the endpoints {ends!r}.", "Give two numbers of vertices.")
    for end in ends:
        if not 0 <= end < len(vertices):
            raise InputError(f"{where} names vertex {end} of {len(vertices)}.", "Vertices count from 0.")
    chord = vertices[ends]
    curve = _curve(f"{where}: curvature", edge.get("curvature"), chord, unit, absolute)
    return PatternEdge(ends[0], ends[1], curve, _label(where, edge))


def _curve(where: str, entries: Any, chord: Floats, unit: float, absolute: bool) -> Curve:
    if entries is None or entries in ([], {}):
        return Straight()
    if isinstance(entries, list):  # the old form of a quadratic curve
        entries = {"type": "quadratic", "params": [entries]}
    kind, params = _table(where, entries).get("type"), entries.get("params")
    if isinstance(kind, str) and kind in POINTS_OF:
        controls = _numbers(where, params, (POINTS_OF[kind], 2))
        if absolute and not np.ptp(chord, axis=0).any():
            raise InputError(f"{where}: the edge has no length.", "Remove it.")
        controls = np.array(along_chord(unit * controls, *chord)) if absolute else controls
        points = tuple((float(x), float(y)) for x, y in controls)
        return Polyline(points) if kind == "polyline" else Bezier(points)
    if kind == "circle":
        radius, large, right = _numbers(where, params, (3,))
        if not radius > 0:
            raise InputError(f"{where}: a circle of radius {radius:g}.", "Give a positive radius.")
        return Arc(unit * float(radius), bool(large), bool(right))
    raise InputError(f"{where} is of the type {kind!r}.", "Known: quadratic, cubic, circle, polyline.")


def _stitch(number: int, entries: Any) -> Stitch:
    where = f"Stitch {number}"
    if not isinstance(entries, list) or len(entries) not in (2, 3):
        raise InputError(f"{where} is not a pair of sides.", 'Give [{"panel": ..., "edge": ...}, {...}].')
    sides = []
    for entry in entries[:2]:
        side = _table(where, entry)
        if type(side.get("edge")) is not int or not isinstance(side.get("panel"), str):
            raise InputError(f"{where} has the side {side!r}.", "Give the name of a panel and the number of an edge.")
        sides.append(Side(side["panel"], side["edge"]))
    if len(entries) == 3 and entries[2] != "right_wrong":
        raise InputError(f"{where} ends with {entries[2]!r}.", "The third entry may be right_wrong.")
    return Stitch(sides[0], sides[1], len(entries) == 3)


def _edge_entries(edge: PatternEdge, units: float) -> dict[str, Any]:
    entries: dict[str, Any] = {"endpoints": [edge.start, edge.end]}
    if isinstance(edge.curve, Bezier):
        kind = "quadratic" if len(edge.curve.controls) == 1 else "cubic"
        entries["curvature"] = {"type": kind, "params": [list(point) for point in edge.curve.controls]}
    if isinstance(edge.curve, Polyline):
        entries["curvature"] = {"type": "polyline", "params": [list(point) for point in edge.curve.inner]}
    if isinstance(edge.curve, Arc):
        params = [units * edge.curve.radius, int(edge.curve.large), int(edge.curve.right)]
        entries["curvature"] = {"type": "circle", "params": params}
    return {**entries, "label": edge.label} if edge.label else entries


def _table(where: str, value: Any, key: str = "") -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise InputError(f"{where} has no table {key!r}." if key else f"{where} is not a table.")
    return value


def _given(entries: Mapping[str, Any], key: str, default: Any) -> Any:
    """Value of a key; the default where it is absent or null."""
    value = entries.get(key)
    return default if value is None else value


def _label(where: str, entries: Mapping[str, Any]) -> str:
    label = _given(entries, "label", "")
    if not isinstance(label, str) or not label.isprintable():
        raise InputError(f"{where} has the label {label!r}.", "Give a word.")
    return label


def _without_duplicates(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Table of a JSON object; ValueError for a key that is given twice, of which one would be lost."""
    table = dict(pairs)
    if len(table) < len(pairs):
        twice = Counter(key for key, _ in pairs).most_common(1)[0][0]
        raise ValueError(f"the key {twice!r} is given twice")
    return table


def _numbers(where: str, value: Any, shape: tuple[int, ...]) -> Floats:
    """Array of finite numbers of a shape, in which -1 is any length."""
    try:
        numbers = np.array(value)
    except (TypeError, ValueError):  # ragged lists
        numbers = np.zeros(0)
    fits = numbers.ndim == len(shape) and all(n in (-1, m) for n, m in zip(shape, numbers.shape, strict=False))
    if not fits or numbers.dtype.kind not in "iuf" or not np.isfinite(numbers).all():  # no words, no logical values
        size = " x ".join("n" if n < 0 else str(n) for n in shape)
        raise InputError(f"{where} must be {size} finite numbers.")
    return numbers.astype(np.float64)
