"""Animated surfaces as a file format takes them: in its unit and axes, with normals, texture and colours."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from clothsim.base.arrays import Floats, Ints
from clothsim.base.triangles import vertex_normals


@dataclass(frozen=True)
class AnimatedPart:
    """A cloth or body; all but its positions is the same in all frames.

    Attributes
    ----------
    name : str
    role : "cloth" or "body"
    triangles : (m, 3) ndarray
        Of its own vertices, from 0.
    texture : (m, 3, 2) or (0, 3, 2) ndarray
        Texture coordinates of each corner, where there are any.
    groups : mapping of str to (k,) ndarray
        Triangles of each panel.
    moving : bool
        False where its positions are the same in all frames.
    joined : (m,) or (0,) bool ndarray
        True where a triangle goes on with the polygon of the one before it, which is a fan about the first corner of
        its first triangle; none: all polygons are triangles.
    """

    name: str
    role: Literal["cloth", "body"]
    triangles: Ints
    texture: Floats
    groups: Mapping[str, Ints]
    moving: bool
    joined: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, bool))

    @property
    def polygons(self) -> int:
        """Number of polygons of more than three corners."""
        return int((self.joined[1:] & ~self.joined[:-1]).sum())

    @cached_property
    def first_triangles(self) -> Ints:
        """First triangle of each polygon, (f,)."""
        return np.flatnonzero(~self.joined) if len(self.joined) else np.arange(len(self.triangles))

    def corners(self, of_triangles: Ints) -> tuple[Ints, Ints]:
        """Numbers (c,) at the corners of the polygons, of those (m, 3) of the triangles; how many each polygon has."""
        first = self.first_triangles
        sizes = np.diff(np.append(first, len(self.triangles))) + 2
        at = np.concatenate([[0], np.cumsum(sizes)])
        flat = np.zeros(at[-1], of_triangles.dtype)
        row = np.arange(len(self.triangles))
        polygon = np.searchsorted(first, row, side="right") - 1
        flat[at[:-1]], flat[at[:-1] + 1] = of_triangles[first, 0], of_triangles[first, 1]
        flat[at[polygon] + 2 + row - first[polygon]] = of_triangles[:, 2]
        return flat, sizes


@dataclass(frozen=True)
class PartFrame:
    """A part in a frame.

    Attributes
    ----------
    points : (n, 3) ndarray
        Vertices in the unit and axes of the file.
    triangles : (m, 3) ndarray
    stretch : (m,) or (0,) ndarray
        Principal stretch of each triangle that is farthest from 1 in its logarithm; none of a body.
    colours : (n, 3) or (0, 3) ndarray
        sRGB in [0, 1] of each vertex; none of a body.
    """

    points: Floats
    triangles: Ints
    stretch: Floats
    colours: Floats

    @cached_property
    def normals(self) -> Floats:
        """Unit normals of the vertices, (n, 3): means of their triangles' by area; z where they cancel."""
        return vertex_normals(self.points, self.triangles)


@dataclass(frozen=True)
class Animation:
    """Surfaces over time.

    Attributes
    ----------
    parts : tuple of AnimatedPart
        Cloths, then bodies.
    times : (k,) ndarray
        Of the frames [s].
    rate : float
        Frames a second.
    unit : float
        Metres per unit of the file.
    up : "y" or "z"
        Axis against gravity.
    origin : (3,) ndarray
        Position to which all points are relative, in the unit and axes of the file; zero but for scenes far from it.
    at : function of a frame number
        The parts in that frame, in their order.
    alone : bool
        True for one frame that is to be a still file.
    """

    parts: tuple[AnimatedPart, ...]
    times: Floats
    rate: float
    unit: float
    up: Literal["y", "z"]
    origin: Floats
    at: Callable[[int], tuple[PartFrame, ...]]
    alone: bool = False


def flat_texture(part: AnimatedPart) -> tuple[Floats, Ints]:
    """Different texture coordinates (t, 2), and the row of each corner (m, 3)."""
    rows, corners = np.unique(part.texture.reshape(-1, 2), axis=0, return_inverse=True)
    return rows, corners.reshape(-1, 3).astype(np.int64)


def split_vertices(part: AnimatedPart, count: int) -> tuple[Ints, Ints, Floats]:
    """Rows of a mesh whose vertices have one texture coordinate each.

    Returns
    -------
    vertices : (r, ) ndarray
        Vertex of each row; the first `count` are 0, 1, ...
    triangles : (m, 3) ndarray
        Rows of the corners.
    texture : (r, 2) or (0, 2) ndarray
    """
    if not len(part.texture):
        return np.arange(count), part.triangles, np.zeros((0, 2))
    corners, coordinates = part.triangles.ravel(), part.texture.reshape(-1, 2)
    different, first, of_corner = np.unique(
        np.column_stack([corners, coordinates]), axis=0, return_index=True, return_inverse=True
    )
    of_corner = of_corner.ravel()
    vertex = corners[first]
    leading = np.unique(vertex, return_index=True)[1]  # the first row of each vertex that is in a triangle
    rows = np.empty(len(different), np.int64)
    rows[leading] = vertex[leading]
    copies = np.setdiff1d(np.arange(len(different)), leading)
    rows[copies] = count + np.arange(len(copies))
    vertices = np.concatenate([np.arange(count), vertex[copies]])
    texture = np.zeros((len(vertices), 2))
    texture[rows] = coordinates[first]
    return vertices, rows[of_corner].reshape(-1, 3), texture


def vertex_means(values: Floats, triangles: Ints, count: int) -> Floats:
    """Means at the vertices (count,) of the values of their triangles (m,); 1 at a vertex in none."""
    corners = triangles.ravel()
    number = np.bincount(corners, minlength=count)
    return np.where(number > 0, np.bincount(corners, np.repeat(values, 3), count) / np.maximum(number, 1), 1.0)


def group_runs(part: AnimatedPart) -> list[tuple[tuple[str, ...], int, int]]:
    """Runs of consecutive triangles of the same groups: names of the groups, first triangle, one behind the last."""
    names = list(part.groups)
    member = np.zeros((len(part.triangles), len(names)), bool)
    for column, name in enumerate(names):
        member[part.groups[name], column] = True
    changes = np.flatnonzero((member[1:] != member[:-1]).any(axis=1)) + 1 if len(member) else np.zeros(0, np.int64)
    ends = [0, *changes.tolist(), len(member)]
    return [
        (tuple(name for name, has in zip(names, member[a], strict=True) if has), a, b)
        for a, b in zip(ends[:-1], ends[1:], strict=True)
        if b > a
    ]


def one_word(name: str) -> str:
    """`name` with "_" for spaces."""
    return "_".join(name.split()) or "part"


def plain_word(name: str) -> str:
    """`name` as letters of ASCII, digits, "_" and "-", with "_" for all else: for the names of files."""
    return "".join(c if c.isascii() and (c.isalnum() or c in "_-") else "_" for c in name) or "part"


def identifier(name: str) -> str:
    """`name` as letters of ASCII, digits and "_" that do not begin with a digit."""
    word = plain_word(name).replace("-", "_")
    return f"_{word}" if word[0].isdigit() else word


def different(names: Sequence[str], word: Callable[[str], str]) -> list[str]:
    """The `word` of each name, with a number where an earlier one has it."""
    found: list[str] = []
    for name in names:
        own, number = word(name), 1
        while own in found:
            number += 1
            own = f"{word(name)}_{number}"
        found.append(own)
    return found
