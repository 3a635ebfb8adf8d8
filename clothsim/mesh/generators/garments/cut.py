"""Borders of a garment: unions of half spaces to cut away, and the mesh trimmed to them."""

from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.mesh.topology import border_edges, components


@dataclass(frozen=True)
class Cut:
    """Intersection of half spaces that is cut away: points p with normals (k, 3) . p above offsets (k,) [m]."""

    normals: Floats
    offsets: Floats


def cut(*planes: tuple[tuple[float, float, float] | Floats, Floats | tuple[float, float, float]]) -> Cut:
    """Make a cut from planes (normal, point on it): what lies beyond all of them is cut away."""
    normals = np.array([np.asarray(normal, np.float64) / np.linalg.norm(normal) for normal, _ in planes])
    return Cut(normals, np.array([normal @ np.asarray(at) for normal, (_, at) in zip(normals, planes, strict=True)]))


@dataclass(frozen=True)
class Edge:
    """Level-set function of the border, below 0 in the garment: max over cuts of the min over planes."""

    cuts: tuple[Cut, ...]

    def __call__(self, points: Floats) -> tuple[Floats, Floats]:
        """Return its value (n,) [m] and gradient (n, 3) at `points (n, 3)`."""
        rows = np.arange(len(points))
        values, gradients = [], []
        for one in self.cuts:
            beyond = points @ one.normals.T - one.offsets
            nearest = beyond.argmin(axis=1)
            values.append(beyond[rows, nearest])
            gradients.append(one.normals[nearest])
        most = np.argmax(values, axis=0)
        return np.stack(values)[most, rows], np.stack(gradients)[most, rows]


def trimmed(positions: Floats, triangles: Ints, edge: Edge) -> tuple[Floats, Ints]:
    """Remove the triangles of the half mesh whose centres are cut away; its vertices are not yet on the border.

    The largest component remains, without triangles that have two sides on the border: those would be flattened there.
    """
    remaining = triangles[edge(positions[triangles].mean(axis=1))[0] < 0]
    piece = components(remaining, len(positions))[remaining[:, 0]]
    remaining = remaining[piece == np.bincount(piece).argmax()]
    middle = positions[:, 0] == 0
    for _ in range(32):
        ends, half = border_edges(remaining)
        border_sides = np.bincount(half[~middle[ends].all(axis=1)] // 3, minlength=len(remaining))
        if not (border_sides > 1).any():
            break
        remaining = remaining[border_sides < 2]
    used, renumbered = np.unique(remaining, return_inverse=True)
    return positions[used], renumbered.reshape(-1, 3).astype(np.int64)
