"""Polygon meshes, and their triangulation."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from clothsim.base.arrays import Floats, Ints

MOST_FANS = 32
"""Corners tried as the origin of the fan of a large polygon."""


@dataclass(frozen=True)
class Polygons:
    """Faces of any number of corners.

    positions: (n, 3) in the file's unit; corners: (c,) the vertices of all faces one after the other; starts: (f + 1,)
    face i has corners[starts[i]:starts[i + 1]]; texture: (c, 2) coordinates of each corner, or (0, 2) where absent;
    groups: the faces of each named group; messages: of the reader.
    """

    positions: Floats
    corners: Ints
    starts: Ints
    texture: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    groups: dict[str, Ints] = field(default_factory=dict)
    messages: tuple[str, ...] = ()


def cut_polygons(polygons: Polygons) -> tuple[Ints, Ints, tuple[str, ...]]:
    """Cut every face into triangles, in the order of the faces.

    Returns
    -------
    corners : (m, 3) ndarray
        The triangles, as indices into `polygons.corners`.
    faces : (m,) ndarray
        The face of each triangle.
    messages : tuple of str
        Counts of the faces that were cut.

    Notes
    -----
    A face of more than three corners becomes a fan from the corner that inverts fewest triangles and then has the
    shortest diagonals: of a quad the shorter diagonal, unless it lies outside. The triangulation depends on the shape:
    for files of one topology (frames, a start) use that of the first.
    """
    sizes = np.diff(polygons.starts)
    corner_rows, faces, messages = [np.zeros((0, 3), np.int64)], [np.zeros(0, np.int64)], []
    for size in np.unique(sizes[sizes >= 3]):
        rows = np.flatnonzero(sizes == size)
        corner = polygons.starts[rows, None] + np.arange(size)
        with np.errstate(over="ignore", invalid="ignore"):  # at 1e154 any fan will do
            fans, overlapping = _best_fans(polygons.positions[polygons.corners[corner]])
        corner_rows.append(np.take_along_axis(corner, fans.reshape(len(rows), -1), axis=1).reshape(-1, 3))
        faces.append(np.repeat(rows, size - 2))
        if size > 3:
            name = "quads" if size == 4 else f"faces of {size} corners"
            messages.append(f"{len(rows)} {name} cut into triangles")
        if overlapping.any():
            messages.append(f"{overlapping.sum()} of them fold or bend inward, first face {rows[overlapping][0]}")
    order = np.argsort(np.concatenate(faces), kind="stable")
    return np.concatenate(corner_rows)[order], np.concatenate(faces)[order], tuple(messages)


def _best_fans(points: Floats) -> tuple[Ints, NDArray[np.bool_]]:
    """The fan of each polygon (k, n, 3) as corner numbers (k, n - 2, 3), and True where even that overlaps (k,)."""
    count, size = points.shape[:2]
    best = np.zeros((count, size - 2, 3), np.int64)
    least_turned, shortest = np.full(count, size), np.full(count, np.inf)
    for origin in range(1 if size == 3 else 2 if size == 4 else min(size, MOST_FANS)):
        ring = (origin + np.arange(size)) % size
        fan = np.column_stack([np.full(size - 2, ring[0]), ring[1:-1], ring[2:]])
        spokes = points[:, ring[1:]] - points[:, ring[:1]]
        normals = np.cross(spokes[:, :-1], spokes[:, 1:])
        turned = (np.einsum("kij,kj->ki", normals, normals.sum(axis=1)) < 0).sum(axis=1)
        length = np.linalg.norm(spokes[:, 1:-1], axis=2).sum(axis=1)
        better = (turned < least_turned) | ((turned == least_turned) & (length < shortest * (1 - 1e-6)))
        best[better], least_turned[better], shortest[better] = fan, turned[better], length[better]
    return best, least_turned > 0
