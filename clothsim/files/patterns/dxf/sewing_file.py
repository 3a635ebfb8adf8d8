"""Sewing file: TOML that names the seams of a drawing's pieces, and places them in space."""

import difflib
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.base.file_reading import read_regular_file
from clothsim.files.patterns.dxf.drawing import UNITS
from clothsim.patterns.pattern import Side, Stitch

MOST_BYTES = 1 << 24
TOP = ("units", "size", "layer", "corner_degrees", "notches", "panels", "seam")
OF_PANEL = ("piece", "mirrored", "turn_degrees", "notches", "position", "rotation_degrees", "label")
CORNER_DEGREES = 30.0
WORDS = {str: "a text", bool: "true or false", dict: "a table", list: "tables: [[seam]]", str | int: "a name"}
"""What a key takes, by its type."""


@dataclass(frozen=True)
class PanelKeys:
    """How a piece becomes a panel.

    Attributes
    ----------
    piece : str
        Name of the piece.
    mirrored : bool
        True: the reflection of the piece.
    turn : float
        Turn in the plane, counter-clockwise, after the thread line was turned upright [rad].
    notches : bool
        True: notches end edges.
    position : (3,) array or None
        Place of the middle of the panel [m]; None where the file gives none.
    rotation : (3,) array
        Angles about x, y and z [rad]: R = Rz Ry Rx.
    label : str
        Part of the body; empty for none.
    """

    piece: str
    mirrored: bool = False
    turn: float = 0.0
    notches: bool = True
    position: Floats | None = None
    rotation: Floats = field(default_factory=lambda: np.zeros(3))
    label: str = ""


@dataclass(frozen=True)
class SewingFile:
    """Entries of a sewing file; without one, its defaults.

    Attributes
    ----------
    units, size, layer : str
        Unit of the drawing, size of its pieces, layer of outlines; empty where not given.
    corner : float
        Turn of an outline at which an edge ends [rad].
    notches : bool
        True: notches end edges, where a panel does not say otherwise.
    panels : mapping of str to PanelKeys
        Panels by name.
    seams : tuple of Stitch
        Seams in order.
    """

    units: str = ""
    size: str = ""
    layer: str = ""
    corner: float = np.radians(CORNER_DEGREES)
    notches: bool = True
    panels: Mapping[str, PanelKeys] = field(default_factory=dict)
    seams: tuple[Stitch, ...] = ()


def read_sewing_file(path: Path) -> SewingFile:
    """Entries of a sewing file. InputError for a file that is none, naming the key."""
    try:
        absent = "Write the seams to it, or name another file with --seams."
        data = tomllib.loads(read_regular_file(path, MOST_BYTES, absent).decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path} is not a TOML file: {error}.", "Write key = value, as in toml.io.") from error
    try:
        return sewing_of(data)
    except InputError as error:
        raise InputError(f"{path.name}: {error.sentence}", error.remedy) from error


def sewing_of(data: Mapping[str, Any]) -> SewingFile:
    """Entries of a sewing file as tables. InputError as `read_sewing_file`."""
    _refuse_unknown("The file", data, TOP)
    units = _take_value(data, "units", str, "")
    if units and units not in UNITS:
        raise InputError(f"units is {units!r}.", f"Known: {', '.join(UNITS)}.")
    corner = _number("corner_degrees", data.get("corner_degrees", CORNER_DEGREES))
    if not 0 < corner < 180:
        raise InputError(f"corner_degrees is {corner:g}.", "Give an angle between 0 and 180 degrees.")
    notches = _take_value(data, "notches", bool, True)
    panels = _take_value(data, "panels", dict, {})
    seams = _take_value(data, "seam", list, [])
    return SewingFile(
        units,
        _take_value(data, "size", str, ""),
        str(_take_value(data, "layer", str | int, "")),
        float(np.radians(corner)),
        notches,
        {name: _panel(name, keys, notches) for name, keys in panels.items()},
        tuple(_seam(number, keys) for number, keys in enumerate(seams)),
    )


def _panel(name: str, keys: Any, notches: bool) -> PanelKeys:
    where = f"panels.{name}"
    if not isinstance(keys, Mapping):
        raise InputError(f"{where} is no table.", f"Write [{where}] and its keys below.")
    _refuse_unknown(where, keys, OF_PANEL)
    position = keys.get("position")
    return PanelKeys(
        _take_value(keys, "piece", str, name, where),
        _take_value(keys, "mirrored", bool, False, where),
        float(np.radians(_number(f"{where}.turn_degrees", keys.get("turn_degrees", 0)))),
        _take_value(keys, "notches", bool, notches, where),
        None if position is None else _three(f"{where}.position", position),
        np.radians(_three(f"{where}.rotation_degrees", keys.get("rotation_degrees", [0, 0, 0]))),
        _take_value(keys, "label", str, "", where),
    )


def _seam(number: int, keys: Any) -> Stitch:
    where = f"seam {number}"
    if not isinstance(keys, Mapping):
        raise InputError(f"{where} is no table.", "Write [[seam]] and from and to below.")
    _refuse_unknown(where, keys, ("from", "to", "right_wrong"))
    sides = []
    for end in ("from", "to"):
        side = keys.get(end)
        if not (isinstance(side, Mapping) and isinstance(side.get("panel"), str) and type(side.get("edge")) is int):
            raise InputError(f"{where} has no panel and edge under {end}.", f'{end} = {{ panel = "front", edge = 2 }}')
        _refuse_unknown(f"{where}.{end}", side, ("panel", "edge"))
        sides.append(Side(side["panel"], side["edge"]))
    return Stitch(sides[0], sides[1], _take_value(keys, "right_wrong", bool, False, where))


def _refuse_unknown(where: str, keys: Mapping[str, Any], known: tuple[str, ...]) -> None:
    for key in keys:
        if key not in known:
            close = difflib.get_close_matches(key, known, n=1)
            hint = f"Did you mean {close[0]!r}?" if close else f"Known: {', '.join(known)}."
            raise InputError(f"{where} has no key {key!r}.", hint)


def _take_value(keys: Mapping[str, Any], key: str, kind: Any, default: Any, where: str = "") -> Any:
    value = keys.get(key, default)
    if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
        name = f"{where}.{key}" if where else key
        raise InputError(f"{name} is {value!r}.", f"Give {WORDS[kind]}.")
    return value


def _number(where: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value):
        raise InputError(f"{where} is {value!r}.", "Give a number.")
    return float(value)


def _three(where: str, value: Any) -> Floats:
    if not isinstance(value, list) or len(value) != 3:
        raise InputError(f"{where} is {value!r}.", "Give three numbers.")
    return np.array([_number(where, each) for each in value])
