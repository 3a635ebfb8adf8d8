"""Pieces of a DXF drawing: the curves of their outlines, notches, thread and mirror lines, by AAMA's layers."""

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError, MissingPackageError
from clothsim.base.file_reading import Budget, read_regular_file
from clothsim.files.patterns.dxf.outline import Part, parts_of_bezier, straight_parts
from clothsim.patterns.curves import Arc, Straight

FLAT = 1e-5
"""Distance of chords from the spline that they stand for [m]."""
CURVES = frozenset({"LINE", "ARC", "CIRCLE", "ELLIPSE", "SPLINE"})


def exploded(entity: Any) -> Iterator[Any]:
    """Lines and arcs of a polyline; another entity as it is."""
    if entity.dxftype() not in ("POLYLINE", "LWPOLYLINE"):
        yield entity
        return
    for part in entity.virtual_entities():
        part.dxf.layer = entity.dxf.layer
        yield part


def in_plane(point: Any) -> Floats:
    """x and y of a point of the drawing."""
    return np.array([point[0], point[1]], np.float64)


def curves_of_entity(entity: Any, metres: float, budget: Budget) -> tuple[Part, ...]:
    """Curves of an entity of an outline [m]; none of a text or a point. The points of flattened ones are counted."""
    kind = entity.dxftype()
    if kind == "LINE":
        return (Part(metres * in_plane(entity.dxf.start), metres * in_plane(entity.dxf.end), Straight()),)
    if kind in ("ARC", "CIRCLE"):
        # both halves of an arc or a circle, so that neither closes on itself
        if kind == "CIRCLE":
            first, sweep = 0.0, 360.0
        else:
            first = entity.dxf.start_angle
            sweep = (entity.dxf.end_angle - first) % 360.0 or 360.0
        angles = [first, first + sweep] if sweep < 270.0 else [first, first + sweep / 2, first + sweep]
        ends = [metres * in_plane(point) for point in entity.vertices(angles)]
        large, right = len(angles) == 2 and sweep > 180.0, entity.dxf.extrusion[2] > 0
        radius = metres * float(entity.dxf.radius)
        return tuple(Part(a, b, Arc(radius, large, right)) for a, b in zip(ends, ends[1:], strict=False))
    if kind == "ELLIPSE":
        return _flattened(entity, metres, budget)
    if kind != "SPLINE":
        return ()
    spline = entity.construction_tool()
    points = metres * np.array([in_plane(point) for point in spline.control_points])
    if not spline.is_rational and spline.is_clamped and spline.degree in (2, 3) and len(points) == spline.degree + 1:
        return parts_of_bezier(points)
    return _flattened(spline, metres, budget)


def _flattened(curve: Any, metres: float, budget: Budget) -> tuple[Part, ...]:
    """Chords of an ellipse or a spline."""
    try:
        points = list(budget.counted(curve.flattening(FLAT / metres), "points", "points of a piece"))
    except (ValueError, OverflowError, ZeroDivisionError, RecursionError) as error:
        raise InputError(
            f"{budget.name}: a curve of an outline cannot be flattened ({type(error).__name__}).",
            "Draw it smaller, or as a polyline.",
        ) from error
    return straight_parts(metres * np.array([in_plane(point) for point in points])) if points else ()


BOUNDARY, CURVE_POINTS, NOTCHES, MIRROR, GRAIN, SEW = "1", "3", "4", "6", "7", "14"
"""Layers of AAMA and ASTM D6673: cut line, points on curves, notches, mirror line, thread line, sew line."""
UNITS = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "inch": 0.0254}
"""Metres in a unit by its name."""
HEADER_UNITS = {1: "inch", 4: "mm", 5: "cm", 6: "m"}
"""Units by the number of $INSUNITS."""
SYSTEMS = {"metric": "mm", "english": "inch"}
"""Units by the text "Units: ..." of AAMA."""
LARGEST = 64 * 2**20
"""Largest file that is read [bytes]."""


@dataclass(frozen=True)
class Piece:
    """A block of the drawing.

    Attributes
    ----------
    name, size : str
        Texts "Piece Name: ..." and "Size: ..."; the name of the block, and empty, without them.
    layer : str
        Layer of the outline.
    parts : tuple of Part
        Curves of the outline in the order of the file [m].
    notches, curve_points : (k, 2) array
        Notches, and points at which the outline is a curve, however it turns [m].
    inserted : bool
        True where the drawing shows the block: the sample size, of several.
    grain, mirror : (2, 2) array or None
        Ends of the thread line and of the mirror line [m].
    """

    name: str
    size: str
    layer: str
    parts: tuple[Part, ...]
    notches: Floats
    curve_points: Floats
    inserted: bool
    grain: Floats | None
    mirror: Floats | None


@dataclass(frozen=True)
class Drawing:
    """Pieces of a DXF file; sample_size: as the text "Sample Size: ..." names it, or empty."""

    pieces: tuple[Piece, ...]
    sample_size: str
    notes: tuple[str, ...]


def read_drawing(path: Path, units: str = "", layer: str = "") -> Drawing:
    """Pieces of a DXF file that have outlines.

    Parameters
    ----------
    path : Path
        The file: one block for each piece.
    units : str
        "mm", "cm", "m" or "inch"; empty: of the text "Units: ...", else of $INSUNITS, else mm with a note.
    layer : str
        Layer of the outlines; empty: 14 (the sew line) for a piece that has it, else 1.

    Raises
    ------
    MissingPackageError
        ezdxf is not installed.
    InputError
        A file that is not a DXF drawing, or has no piece.
    """
    document = _document(path)
    system = _value_of(_texts(document.modelspace()), "units").lower()
    unit = units or SYSTEMS.get(system) or HEADER_UNITS.get(document.header.get("$INSUNITS", 0))
    notes = () if unit else ("the drawing names no units: its lengths are read as millimetres",)
    unit = unit or "mm"
    budget = Budget(path.name)
    found = (_piece(*block, UNITS[unit], layer, budget) for block in _blocks(document))
    pieces = tuple(piece for piece in found if piece is not None)
    if not pieces:
        raise InputError(
            f"{path.name} has no piece: no block with an outline on layer {layer or f'{SEW} or {BOUNDARY}'}.",
            "Export it as AAMA or ASTM DXF, or name the layer: layer = ... in the file of --seams.",
        )
    return Drawing(pieces, _value_of(_texts(document.modelspace()), "sample size"), notes)


def _document(path: Path) -> Any:
    try:
        from ezdxf import DXFError, recover
    except ImportError as error:
        raise MissingPackageError("A DXF pattern needs the package ezdxf.", "pip install 'clothsim[dxf]'") from error
    data = read_regular_file(path, LARGEST, "Name a DXF file.")
    try:
        return recover.read(BytesIO(data))[0]
    except (DXFError, OSError, ValueError, TypeError, KeyError, IndexError, AttributeError) as error:
        raise InputError(
            f"{path.name} is not a DXF drawing that ezdxf reads: {error}.", "Export it again, as ASCII DXF."
        ) from error


def _blocks(document: Any) -> Iterator[tuple[str, list[Any], bool]]:
    """Name and entities of each block, as placed where it is inserted, and whether it is."""
    inserts = {insert.dxf.name: insert for insert in document.modelspace().query("INSERT")}
    for block in document.blocks:
        if not block.name.startswith("*"):
            insert = inserts.get(block.name)
            yield block.name, list(block if insert is None else insert.virtual_entities()), insert is not None


def _texts(entities: Iterable[Any]) -> Iterator[str]:
    """Contents of texts."""
    for entity in entities:
        if entity.dxftype() == "TEXT":
            yield entity.dxf.text
        if entity.dxftype() == "MTEXT":
            yield entity.plain_text()


def _piece(block: str, given: Iterable[Any], inserted: bool, metres: float, layer: str, budget: Budget) -> Piece | None:
    """The piece of a block; None for one without an outline."""
    budget.spent["points of a piece"] = 0
    drawn_parts = (part for entity in given for part in exploded(entity))
    entities = list(budget.counted(drawn_parts, "points", "points of a piece"))
    layers: dict[str, list[Any]] = {}
    for entity in entities:
        layers.setdefault(str(entity.dxf.layer).strip(), []).append(entity)
    drawn = {name for name, those in layers.items() if any(each.dxftype() in CURVES for each in those)}
    outline = layer or (SEW if SEW in drawn else BOUNDARY)
    if outline not in drawn:
        return None
    texts = list(_texts(entities))
    parts = tuple(part for entity in layers[outline] for part in curves_of_entity(entity, metres, budget))
    return Piece(
        _value_of(texts, "piece name") or block,
        _value_of(texts, "size"),
        outline,
        parts,
        _points(layers.get(NOTCHES, []), metres),
        _points(layers.get(CURVE_POINTS, []), metres),
        inserted,
        _line(layers.get(GRAIN, []), metres),
        _line(layers.get(MIRROR, []), metres),
    )


def _value_of(texts: Iterable[str], key: str) -> str:
    """What a text "KEY: ..." says; empty where there is none."""
    pattern = re.compile(rf"\s*{key}\s*:\s*(.*?)\s*$", re.IGNORECASE)
    return next((match[1] for text in texts if (match := pattern.match(text)) and match[1]), "")


def _points(entities: Iterable[Any], metres: float) -> Floats:
    """Points, (k, 2) [m]."""
    points = [metres * in_plane(each.dxf.location) for each in entities if each.dxftype() == "POINT"]
    return np.reshape(np.array(points, np.float64), (-1, 2))


def _line(entities: Iterable[Any], metres: float) -> Floats | None:
    """Ends of the longest line, (2, 2) [m]; None where there is none."""
    lines = [metres * np.array([in_plane(e.dxf.start), in_plane(e.dxf.end)]) for e in entities if e.dxftype() == "LINE"]
    return max(lines, key=lambda line: float(np.linalg.norm(line[1] - line[0])), default=None)
