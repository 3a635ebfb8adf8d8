"""Sewing patterns by the ending of their file: a `specification.json`, or a DXF drawing with its sewing file.

A sewing file is TOML that names the seams of a drawing's pieces, and places them in space.
"""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.base.file_reading import read_regular_file
from clothsim.base.inputs import is_number, refuse_unknown
from clothsim.files.patterns.dxf.drawing import SEW, UNITS, Piece, read_drawing
from clothsim.files.patterns.dxf.outline import Part, loop_of, outline_edges, polygon, reflected, unfolded
from clothsim.patterns.pattern import Panel, Pattern, Side, Stitch
from clothsim.patterns.specification import USUAL_UNITS, read_specification

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
    """Entries of a sewing file. InputError for any other file, naming the key."""
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
    refuse_unknown("The file", data, TOP)
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
        {name: _panel_keys(name, keys, notches) for name, keys in panels.items()},
        tuple(_seam(number, keys) for number, keys in enumerate(seams)),
    )


def _panel_keys(name: str, keys: Any, notches: bool) -> PanelKeys:
    where = f"panels.{name}"
    if not isinstance(keys, Mapping):
        raise InputError(f"{where} is not a table.", f"Write [{where}] and its keys below.")
    refuse_unknown(where, keys, OF_PANEL)
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
        raise InputError(f"{where} is not a table.", "Write [[seam]] and from and to below.")
    refuse_unknown(where, keys, ("from", "to", "right_wrong"))
    sides = []
    for end in ("from", "to"):
        side = keys.get(end)
        if not (isinstance(side, Mapping) and isinstance(side.get("panel"), str) and type(side.get("edge")) is int):
            raise InputError(f"{where} has no panel and edge under {end}.", f'{end} = {{ panel = "front", edge = 2 }}')
        refuse_unknown(f"{where}.{end}", side, ("panel", "edge"))
        sides.append(Side(side["panel"], side["edge"]))
    return Stitch(sides[0], sides[1], _take_value(keys, "right_wrong", bool, False, where))


def _take_value(keys: Mapping[str, Any], key: str, kind: Any, default: Any, where: str = "") -> Any:
    value = keys.get(key, default)
    if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
        name = f"{where}.{key}" if where else key
        raise InputError(f"{name} is {value!r}.", f"Give {WORDS[kind]}.")
    return value


def _number(where: str, value: Any) -> float:
    if not is_number(value) or not np.isfinite(value):
        raise InputError(f"{where} is {value!r}.", "Give a number.")
    return float(value)


def _three(where: str, value: Any) -> Floats:
    if not isinstance(value, list) or len(value) != 3:
        raise InputError(f"{where} is {value!r}.", "Give three numbers.")
    return np.array([_number(where, each) for each in value])


ON_OUTLINE, ON_CUT_LINE = 2e-3, 3e-2
"""Largest distance of a notch from the outline, and from a sew line inside the cut line that it lies on [m]."""
LEVEL = np.radians(1.0)
"""Angle below the horizontal of a thread line that counts as horizontal [rad]."""


def read_dxf_pattern(path: str | Path, seams: str | Path | None = None, sewn: bool = True) -> Pattern:
    """Read a DXF drawing of AAMA or ASTM as a sewing pattern.

    Parameters
    ----------
    path : str or Path
        The drawing: a block for each piece, its outline on layer 14 (sew line) or 1.
    seams : str or Path, optional
        TOML file with seams and placement; None: the file NAME.toml beside NAME.dxf.
    sewn : bool
        False: seams and placement may be absent, as where a pattern is looked at.

    Returns
    -------
    Pattern
        In metres and radians. Edges end at corners and notches, and count from 0, counter-clockwise.

    Raises
    ------
    MissingPackageError
        ezdxf is not installed.
    InputError
        An open outline, a missing piece, panel, edge, seam or placement, by name.
    """
    file = Path(path)
    sewing_path = file.with_suffix(".toml") if seams is None else Path(seams)
    given = seams is not None or sewing_path.is_file()
    sewing = read_sewing_file(sewing_path) if given else SewingFile()
    drawing = read_drawing(file, sewing.units, sewing.layer)
    pieces, sizes = drawing.pieces, sorted({piece.size for piece in drawing.pieces if piece.size})
    if sewing.size and sewing.size not in sizes:
        raise InputError(
            f"{file.name} has no pieces of size {sewing.size!r}.", f"Sizes: {', '.join(sizes) or 'none is named'}."
        )
    size = sewing.size or (drawing.sample_size if drawing.sample_size in sizes else "")
    if size:
        pieces = tuple(piece for piece in pieces if piece.size in (size, ""))
    elif any(piece.inserted for piece in pieces):
        pieces = tuple(piece for piece in pieces if piece.inserted)
    of_size: dict[str, Piece] = {}
    for piece in pieces:
        if piece.name in of_size:
            both = f"{of_size[piece.name].size or 'unnamed'} and {piece.size or 'unnamed'}"
            raise InputError(
                f"{file.name} has the piece {piece.name} twice, of sizes {both}.",
                f'Choose a size in the file of --seams: size = "{sizes[0]}".' if len(sizes) > 1 else "Rename one.",
            )
        of_size[piece.name] = piece
    left = [each for each in sizes if each not in {piece.size for piece in of_size.values()}]
    read = ", ".join(sorted({piece.size for piece in of_size.values()} - {""}))
    notes = (*drawing.notes, *([f"size {read}; left out: {', '.join(left)}"] if left else []))
    used = {keys.piece for keys in sewing.panels.values()}
    others = [name for name in of_size if name not in used]
    left_out = others if sewn and used else []
    tables = {**sewing.panels, **{name: PanelKeys(name, notches=sewing.notches) for name in others}}
    panels = {name: _panel(name, keys, of_size, sewing) for name, keys in tables.items() if name not in left_out}
    if sewn:
        look = f"`clothsim check {file.name} -o edges.svg` draws the edges with their numbers."
        if not given:
            raise InputError(f"{file.name} names no seams, and there is no {sewing_path}.", f"Write them to it: {look}")
        if not sewing.seams and len(panels) > 1:
            raise InputError(f"{sewing_path.name} has no [[seam]].", look)
        lost = [name for name in panels if name not in sewing.panels or sewing.panels[name].position is None]
        if lost and len(panels) > 1:
            raise InputError(
                f"{sewing_path.name} places no panel {', '.join(lost)}.",
                f"Give each its place in metres, y upward from the floor: [panels.{lost[0]}] position = [0, 1.2, 0.2].",
            )
    if left_out:
        notes += (f"pieces without a table [panels.NAME] are left out: {', '.join(left_out)}",)
    source = {"properties": {"units_in_meter": USUAL_UNITS}}
    try:
        return Pattern(panels, sewing.seams, notes, source)
    except InputError as error:
        raise InputError(f"{sewing_path.name}: {error.sentence}", error.remedy) from error


def _panel(name: str, keys: PanelKeys, pieces: dict[str, Piece], sewing: SewingFile) -> Panel:
    if keys.piece not in pieces:
        raise InputError(f"Panel {name}: there is no piece {keys.piece!r}.", f"Pieces: {', '.join(pieces)}.")
    piece = pieces[keys.piece]
    half = loop_of(piece.name, piece.layer, piece.parts)
    loop = unfolded(half, piece.mirror)
    notches, curve_points = piece.notches if keys.notches else np.zeros((0, 2)), piece.curve_points
    if loop is not half and piece.mirror is not None:
        notches, curve_points = (
            np.concatenate([points, reflected(points, piece.mirror)]) for points in (notches, curve_points)
        )
    reach = ON_CUT_LINE if piece.layer == SEW else ON_OUTLINE
    vertices, edges = outline_edges(loop, notches, curve_points, reach, sewing.corner)
    turn = keys.turn + _upright(piece.grain)
    cosine, sine = np.cos(turn), np.sin(turn)
    matrix = np.array([[cosine, sine], [-sine, cosine]])  # rows are points
    border = polygon(loop) @ matrix
    middle = (border.min(axis=0) + border.max(axis=0)) / 2
    flat = Panel(name, vertices @ matrix - middle, edges, np.zeros(3), keys.rotation, keys.label)
    panel = mirrored_panel(flat) if keys.mirrored else flat
    return panel if keys.position is None else replace(panel, translation=keys.position)


def mirrored_panel(panel: Panel) -> Panel:
    """The reflection of a panel in x; its edges keep their numbers."""
    axis = np.array([[0.0, 0.0], [0.0, 1.0]])
    ends = [(panel.vertices[edge.start], panel.vertices[edge.end]) for edge in panel.edges]
    drawn = (Part(*both, edge.curve) for both, edge in zip(ends, panel.edges, strict=True))
    edges = tuple(replace(edge, curve=part.mirrored(axis).curve) for edge, part in zip(panel.edges, drawn, strict=True))
    return replace(panel, vertices=panel.vertices * [-1, 1], edges=edges)


def _upright(grain: Floats | None) -> float:
    """Turn that makes a thread line upright [rad], by a quarter turn at most; a horizontal one counter-clockwise."""
    if grain is None or not np.ptp(grain, axis=0).any():
        return 0.0
    along = grain[1] - grain[0]
    angle = float(np.arctan2(along[1], along[0])) % np.pi
    return np.pi / 2 - (angle - np.pi if angle > np.pi - LEVEL else angle)


DXF = ".dxf"


def read_pattern(
    path: str | Path, rotation_order: str = "zyx", seams: str | Path | None = None, sewn: bool = True
) -> Pattern:
    """Read a sewing pattern: a DXF drawing with its sewing file, else a `specification.json`.

    Parameters
    ----------
    path : str or Path
        The file.
    rotation_order : str
        Order of the rotations of a specification, "zyx" or "xyz".
    seams : str or Path, optional
        Sewing file of a drawing; None: NAME.toml beside NAME.dxf.
    sewn : bool
        False: a drawing needs no sewing file.

    Raises
    ------
    MissingPackageError
        A drawing, and ezdxf is not installed.
    InputError
        A file that is not a pattern, naming its panel, edge or stitch; seams for a file that names its own.
    """
    if Path(path).suffix.lower() != DXF:
        if seams is not None:
            raise InputError(f"{path} names its own stitches.", "Seams by --seams are for DXF drawings.")
        return read_specification(path, rotation_order)
    return read_dxf_pattern(path, seams, sewn)
