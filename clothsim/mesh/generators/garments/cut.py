"""Where a garment ends: half spaces, and a mesh trimmed to their borders."""

from dataclasses import dataclass

import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.mesh.topology import border_edges, components


@dataclass(frozen=True)
class Cut:
    """What is cut away: the points p of which all normals (k, 3) . p are above offsets (k,) [m]."""

    normals: Floats
    offsets: Floats


def cut(*planes: tuple[tuple[float, float, float] | Floats, Floats | tuple[float, float, float]]) -> Cut:
    """A cut from planes (normal, point on it): it takes away what lies beyond all of them."""
    normals = np.array([np.asarray(normal, np.float64) / np.linalg.norm(normal) for normal, _ in planes])
    return Cut(normals, np.array([normal @ np.asarray(at) for normal, (_, at) in zip(normals, planes, strict=True)]))


@dataclass(frozen=True)
class Edge:
    """The function that is below 0 in what is left and 0 at its borders: max over cuts of the min over planes."""

    cuts: tuple[Cut, ...]

    def __call__(self, points: Floats) -> tuple[Floats, Floats]:
        """Its value (n,) [m] and gradient (n, 3) at `points (n, 3)`."""
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
    """The half mesh without the triangles whose centres are cut away; its vertices are not yet on the border.

    The largest piece is kept, and no triangle of it has two sides on the border: those would be flattened there.
    """
    kept = triangles[edge(positions[triangles].mean(axis=1))[0] < 0]
    piece = components(kept, len(positions))[kept[:, 0]]
    kept = kept[piece == np.bincount(piece).argmax()]
    middle = positions[:, 0] == 0
    for _ in range(32):
        ends, half = border_edges(kept)
        sides = np.bincount(half[~middle[ends].all(axis=1)] // 3, minlength=len(kept))
        if not (sides > 1).any():
            break
        kept = kept[sides < 2]
    used, renumbered = np.unique(kept, return_inverse=True)
    return positions[used], renumbered.reshape(-1, 3).astype(np.int64)
