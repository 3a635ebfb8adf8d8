"""Wavefront OBJ: vertices, texture coordinates, faces of any size, groups (`g`) and objects (`o`).

Material files are never opened. Positive indices count from 1 over the whole file, negative ones back from the line.
"""

import re
from collections import Counter
from pathlib import Path

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.files.meshes.obj_columns import polygons_by_columns
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
            self._take_face(words, line)
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

    def _take_face(self, words: list[str], line: int) -> None:
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
    if index == 0 or row < 0 or row >= MOST_INDEX:
        raise ValueError(f"index {index} is out of range, {count} were given so far")
    return row


def _shorten(text: str) -> str:
    return text if len(text) <= 60 else f"{text[:57]}..."
