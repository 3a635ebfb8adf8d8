"""Wavefront OBJ: vertices, texture coordinates, faces of any size, groups (`g`) and objects (`o`), read and written.

Material files are never opened. Positive indices count from 1 over the whole file, negative ones back from the line.

A file whose lines are alike is read by columns, in a tenth of the time: vertices of three numbers, faces of positive
indices in one style, with or without groups. All else, and all faults, are left to the reader that goes line by line.

Output is exact to the last bit: of a mesh, or as a copy of a file with other vertex positions. A copy is an edit of the
text: faces, groups, materials and texture coordinates stay, a `v` line gets its new numbers and keeps what follows them
(colours). Normals (`vn`) are left out, as they are those of the old positions.
"""

import re
import warnings
from collections import Counter
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.base.file_writing import write_atomically
from clothsim.files.meshes.polygons import Polygons

SILENT = {"vn", "vp", "s", "usemtl", "mtllib", "l", "p", "#"}
MOST_INDEX = 2**31
MOST_GROUPS = 64
"""Largest number of groups that a face is in: each repeats its faces."""


def read_obj(path: Path, text: str) -> Polygons:
    """The polygons of `text`. InputError names `path` and the line that cannot be read."""
    alike = polygons_by_columns(text)
    if alike is not None:
        return alike
    lines = _Lines(path)
    for number, line in enumerate(joined_lines(text), start=1):
        words = line.split("#", 1)[0].split() if "#" in line else line.split()
        if not words:
            continue
        try:
            lines.take(words[0], words[1:], number)
        except ValueError as error:
            raise InputError(
                f"{path}, line {number}: {_shorten(line)!r} cannot be read ({_shorten(str(error))})."
            ) from error
    return lines.polygons()


class _Lines:
    """Contents of the lines so far."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.points: list[list[float]] = []
        self.point_lines: list[int] = []
        self.texture_points: list[list[float]] = []
        self.texture_lines: list[int] = []
        self.corners: list[int] = []
        self.texture_corners: list[int] = []
        self.sizes: list[int] = []
        self.face_lines: list[int] = []
        self.objects: tuple[str, ...] = ()
        self.group: tuple[str, ...] = ()
        self.groups: dict[str, list[int]] = {}
        self.ignored: Counter[str] = Counter()

    def take(self, keyword: str, words: list[str], line: int) -> None:
        """Take one line. ValueError names its fault."""
        if keyword == "v":
            self.points.append(_numbers(words, 3))
            self.point_lines.append(line)
        elif keyword == "f":
            if len(words) < 3:
                raise ValueError("a face needs three corners")
            for word in words:
                parts = word.split("/")
                self.corners.append(_index(parts[0], len(self.points)))
                texture = parts[1] if len(parts) > 1 else ""
                self.texture_corners.append(_index(texture, len(self.texture_points)) if texture else -1)
            for name in {*self.group, *self.objects}:
                self.groups.setdefault(name, []).append(len(self.sizes))
            self.sizes.append(len(words))
            self.face_lines.append(line)
        elif keyword == "vt":
            self.texture_points.append(_numbers([*words, "0"] if len(words) == 1 else words, 2))
            self.texture_lines.append(line)
        elif keyword == "g":
            if len(words) > MOST_GROUPS:
                raise ValueError(f"{len(words)} groups at a time, more than {MOST_GROUPS}")
            self.group = tuple(words)
        elif keyword == "o":
            self.objects = (" ".join(words),)
        elif keyword not in SILENT:
            self.ignored[keyword if re.fullmatch(r"[a-z_]{1,12}", keyword) else ""] += 1

    def polygons(self) -> Polygons:
        """The faces of all lines; InputError for an index or number that is out of range."""
        points = self._finite(np.array(self.points, float).reshape(-1, 3), self.point_lines)
        texture_points = self._finite(np.array(self.texture_points, float).reshape(-1, 2), self.texture_lines)
        starts = np.concatenate([[0], np.cumsum(np.array(self.sizes, np.int64))])
        corners, texture_corners = np.array(self.corners, np.int64), np.array(self.texture_corners, np.int64)
        self._in_range(corners, starts, len(points), "vertices")
        self._in_range(texture_corners, starts, len(texture_points), "texture coordinates")
        messages = [
            f"{count} {f'lines {word!r}' if word else 'unknown lines'} ignored"
            for word, count in self.ignored.most_common(5)
        ]
        texture = np.zeros((0, 2))
        with_texture = texture_corners >= 0
        if with_texture.all() and len(texture_corners):
            texture = texture_points[texture_corners]
        elif with_texture.any():
            messages.append(f"texture coordinates ignored: {(~with_texture).sum()} corners have none")
        groups = {name: np.array(faces, np.int64) for name, faces in self.groups.items()}
        return Polygons(points, corners, starts.astype(np.int64), texture, groups, tuple(messages))

    def _finite(self, values: Floats, lines: list[int]) -> Floats:
        bad = np.flatnonzero(~np.isfinite(values).all(axis=1))
        if len(bad):
            raise InputError(f"{self.path}, line {lines[bad[0]]}: {values[bad[0]].tolist()} is not finite.")
        return values

    def _in_range(self, indices: Ints, starts: Ints, count: int, what: str) -> None:
        bad = np.flatnonzero(indices >= count)
        if len(bad):
            face = np.searchsorted(starts, bad[0], side="right") - 1
            raise InputError(
                f"{self.path}, line {self.face_lines[face]}: index {indices[bad[0]] + 1} is out of range, "
                f"the file has {count} {what}."
            )


def joined_lines(text: str) -> list[str]:
    """The lines, continued ones joined; empty lines keep the line numbers."""
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    if "\\\n" not in text.replace("\r", "\n"):
        return lines
    joined: list[str] = []
    start = -1
    for number, line in enumerate(lines):
        if start >= 0:
            joined[start] += " " + line.removesuffix("\\")
            joined.append("")
        else:
            joined.append(line.removesuffix("\\"))
        started = number if start < 0 else start
        start = started if line.endswith("\\") else -1
    return joined


def _numbers(words: list[str], count: int) -> list[float]:
    if len(words) < count:
        raise ValueError(f"{count} numbers expected")
    return [float(word) for word in words[:count]]


def _index(word: str, count: int) -> int:
    """An OBJ index as a row from 0, after `count` rows."""
    index = int(word)
    row = index - 1 if index > 0 else count + index
    if index == 0:
        raise ValueError("index 0 is out of range: OBJ counts from 1")
    if row < 0 or row >= MOST_INDEX:
        raise ValueError(f"index {index} is out of range, {count} were given so far")
    return row


def _shorten(text: str) -> str:
    return text if len(text) <= 60 else f"{text[:57]}..."


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
SKIPPED = ("vn ", "s ", "usemtl ", "mtllib ", "#")


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
        elif line.strip() and not line.startswith(SKIPPED):
            return None
    return found


def _table(lines: list[str], columns: int) -> Floats | None:
    """The numbers of `lines`, (n, columns); None where a line has another count, or something that is not a number."""
    if not lines:
        return np.zeros((0, columns))
    if {len(line.split()) for line in lines} != {columns}:
        return None
    values = _column_numbers(lines, float)
    return values.reshape(-1, columns) if values.size == columns * len(lines) and np.isfinite(values).all() else None


def _corners(lines: list[str]) -> tuple[Ints, Ints, Ints] | None:
    """Vertices (c,) and texture coordinates (c,) or (0,) of all faces from 0, and the starts of the faces (f + 1,)."""
    sizes = np.array([len(line.split()) for line in lines], np.int64)
    joined = " ".join(lines)
    style = next((style for style in STYLES if style.fullmatch(joined)), None)
    if sizes.min() < 3 or style is None:
        return None
    values = _column_numbers([joined.replace("/", " ")], np.int64)
    if not values.size or values.size % sizes.sum():  # a number too large for 64 bits ends the reading
        return None
    table = values.reshape(int(sizes.sum()), -1) - 1
    texture = table[:, 1].copy() if STYLES[style] else np.zeros(0, np.int64)
    return table[:, 0].copy(), texture, np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)


def _column_numbers(lines: list[str], kind: type) -> np.ndarray:
    """All numbers of `lines`; fewer where one cannot be read."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)
        try:
            return np.fromstring(" ".join(lines), dtype=kind, sep=" ")
        except (ValueError, DeprecationWarning):
            return np.zeros(0, kind)


def obj_text(positions: ArrayLike, triangles: ArrayLike) -> str:
    """The text of an OBJ of positions (n, 3) [m] and triangles (m, 3) counted from 0.

    Examples
    --------
    >>> print(obj_text([[0, 0, 0], [1, 0, 0], [0, 0.1, 0]], [[0, 1, 2]]), end="")
    v 0.0 0.0 0.0
    v 1.0 0.0 0.0
    v 0.0 0.1 0.0
    f 1 2 3
    """
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in np.asarray(positions, np.float64).tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (np.asarray(triangles) + 1).tolist()]
    return "\n".join(lines) + "\n"


def write_obj(path: Path, positions: ArrayLike, triangles: ArrayLike) -> Path:
    """Write `obj_text` to `path` and return it. InputError where it cannot be written."""
    write_atomically(path, obj_text(positions, triangles).encode())
    return path


ELEMENTS = ("f", "l", "p")
"""Lines that name vertices."""


def moved_obj(text: str, positions: Floats, rows: Ints) -> str:
    r"""Text of the OBJ `text` with other vertex positions.

    Parameters
    ----------
    text : str
        An OBJ file that `clothsim.files.meshes.readers.obj.read_obj` reads.
    positions : (n, 3) ndarray
        New positions.
    rows : (k,) ndarray
        Row of `positions` of each vertex of the file; -1: the vertex is left out, and what names it, as are those
        that have no row.

    Raises
    ------
    InputError
        Where the file has fewer vertices.

    Examples
    --------
    >>> text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\ng front\nf 1/1 2/1 3/1 4/1\n"
    >>> print(moved_obj(text, 2.0 * np.eye(3), np.array([0, 1, 2, 0])), end="")
    v 2.0 0.0 0.0
    v 0.0 2.0 0.0
    v 0.0 0.0 2.0
    v 2.0 0.0 0.0
    vt 0 0
    g front
    f 1/1 2/1 3/1 4/1
    """
    table = positions.tolist()
    numbers = (np.cumsum(rows >= 0) * (rows >= 0)).tolist()
    lines, seen = [], 0
    for line in joined_lines(text):
        words = line.split("#", 1)[0].split()
        keyword = words[0] if words else ""
        if keyword == "v":
            row = rows[seen] if seen < len(rows) else -1
            seen += 1
            if row >= 0:
                x, y, z = table[row]
                lines.append(" ".join(["v", repr(x), repr(y), repr(z), *words[4:]]))
        elif keyword in ELEMENTS:
            corners = _renumbered_corners(words[1:], seen, numbers)
            if corners:
                lines.append(" ".join([keyword, *corners]))
        elif keyword != "vn":
            lines.append(line)
    if seen < len(rows):
        raise InputError(f"The file has {seen:,} vertices, fewer than {len(rows):,}.")
    return "\n".join(lines).rstrip("\n") + "\n"


def _renumbered_corners(words: list[str], seen: int, numbers: list[int]) -> list[str]:
    """Corners without normals and with the new `numbers`, from 1; empty where a vertex is left out (0)."""
    corners = []
    for word in words:
        vertex, _, rest = word.partition("/")
        texture = rest.partition("/")[0]
        index = int(vertex)
        row = index - 1 if index > 0 else seen + index
        if row >= len(numbers) or not numbers[row]:
            return []
        corners.append(f"{numbers[row]}/{texture}" if texture else f"{numbers[row]}")
    return corners
