"""Wavefront OBJ whose lines are alike, read by columns: a tenth of the time of reading line by line.

Only what needs no interpretation is read here: vertices of three numbers, faces of positive indices in one style, with
or without groups. All else, and all faults, are left to the reader that goes line by line.
"""

import re
import warnings
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.files.meshes.polygons import Polygons

FEWEST = 1000
"""Lines below which nothing is gained."""
STYLES = {
    re.compile(rf"\s*(?:{corner}\s+)*{corner}\s*"): textured
    for corner, textured in (
        ("[0-9]+", False),
        ("[0-9]+/[0-9]+", True),
        ("[0-9]+//[0-9]+", False),
        ("[0-9]+/[0-9]+/[0-9]+", True),
    )
}
"""Corners of faces, all in one style, and True where their second number is that of texture coordinates."""
FEW_GROUPS = 8
"""Names in a line beyond which the other reader decides, which has a bound."""
SILENT = ("vn ", "s ", "usemtl ", "mtllib ", "#")


def polygons_by_columns(text: str) -> Polygons | None:
    """The polygons of `text`; None where some line needs the reader that goes line by line."""
    lines = text.split("\n")
    if len(lines) < FEWEST or "\\" in text or "\r" in text:
        return None
    sorted_lines = _sorted_lines(lines)
    if sorted_lines is None or not sorted_lines.faces:
        return None
    points, texture_points = _table(sorted_lines.points, 3), _table(sorted_lines.texture, 2)
    corners = _corners(sorted_lines.faces)
    if points is None or texture_points is None or corners is None:
        return None
    vertices, texture, starts = corners
    if not (_in_range(vertices, len(points)) and _in_range(texture, len(texture_points))):
        return None
    coordinates = texture_points[texture] if len(texture) else np.zeros((0, 2))
    return Polygons(points, vertices, starts, coordinates, sorted_lines.faces_of_groups())


def _in_range(rows: Ints, count: int) -> bool:
    return not len(rows) or bool(rows.min() >= 0 and rows.max() < count)


@dataclass
class _Sorted:
    """Lines by keyword; groups: number of faces before each line of a group, and its names."""

    points: list[str] = field(default_factory=list)
    texture: list[str] = field(default_factory=list)
    faces: list[str] = field(default_factory=list)
    groups: list[tuple[int, frozenset[str]]] = field(default_factory=list)

    def faces_of_groups(self) -> dict[str, Ints]:
        """Faces of each group, in the order in which the file fills them."""
        found: dict[str, list[Ints]] = {}
        for (first, names), (end, _) in pairwise([*self.groups, (len(self.faces), frozenset[str]())]):
            if end > first:
                for name in names:
                    found.setdefault(name, []).append(np.arange(first, end))
        return {name: np.concatenate(parts) for name, parts in found.items()}


def _sorted_lines(lines: list[str]) -> _Sorted | None:
    """Lines by keyword; None for one that is not known here, or with a comment behind it."""
    found, group, objects = _Sorted(), frozenset[str](), frozenset[str]()
    for line in lines:
        if line.startswith("v "):
            found.points.append(line[2:])
        elif line.startswith("f "):
            found.faces.append(line[2:])
        elif line.startswith("vt "):
            found.texture.append(line[3:])
        elif line.startswith(("g ", "o ")) or line in ("g", "o"):
            names = line[2:].split()
            if "#" in line or len(names) > FEW_GROUPS:
                return None
            if line[0] == "g":
                group = frozenset(names)
            else:
                objects = frozenset([" ".join(names)])
            found.groups.append((len(found.faces), group | objects))
        elif line.strip() and not line.startswith(SILENT):
            return None
    return found


def _table(lines: list[str], columns: int) -> Floats | None:
    """The numbers of `lines`, (n, columns); None where a line has another count, or something that is no number."""
    if not lines:
        return np.zeros((0, columns))
    if {len(line.split()) for line in lines} != {columns}:
        return None
    values = _numbers(lines, float)
    return values.reshape(-1, columns) if values.size == columns * len(lines) and np.isfinite(values).all() else None


def _corners(lines: list[str]) -> tuple[Ints, Ints, Ints] | None:
    """Vertices (c,) and texture coordinates (c,) or (0,) of all faces from 0, and the starts of the faces (f + 1,)."""
    sizes = np.array([len(line.split()) for line in lines], np.int64)
    joined = " ".join(lines)
    style = next((style for style in STYLES if style.fullmatch(joined)), None)
    if sizes.min() < 3 or style is None:
        return None
    values = _numbers([joined.replace("/", " ")], np.int64)
    if not values.size or values.size % sizes.sum():  # a number too large for 64 bits ends the reading
        return None
    table = values.reshape(int(sizes.sum()), -1) - 1
    texture = table[:, 1].copy() if STYLES[style] else np.zeros(0, np.int64)
    return table[:, 0].copy(), texture, np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)


def _numbers(lines: list[str], kind: type) -> np.ndarray:
    """All numbers of `lines`; fewer where one cannot be read."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)
        try:
            return np.fromstring(" ".join(lines), dtype=kind, sep=" ")
        except (ValueError, DeprecationWarning):
            return np.zeros(0, kind)
