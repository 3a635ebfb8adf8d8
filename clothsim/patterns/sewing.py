"""Sewn topology: vertices that stitches join, merged."""

from collections.abc import Sequence

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.patterns.pattern_mesh import PatternMesh, Seam

TOUCHING = 1e-4
"""Gap of a seam that is closed as placed [m]."""


def sewn_vertices(mesh: PatternMesh, seams: Sequence[Seam]) -> Ints:
    """Number of each vertex after `seams` are closed, (n,), as `joined_vertices`."""
    return joined_vertices(mesh, np.concatenate([np.zeros((0, 2), np.int64), *(seam.pairs for seam in seams)]))


def joined_vertices(mesh: PatternMesh, pairs: Ints | None = None) -> Ints:
    """Number of each vertex after `pairs` (k, 2) are joined, (n,): ascending in the order of the first of each group.

    None: those of all seams.
    InputError for pairs that join two corners of one triangle.
    """
    if pairs is None:
        return sewn_vertices(mesh, mesh.seams)
    n = len(mesh.positions)
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    labels = connected_components(graph, directed=False)[1]
    _, first, inverse = np.unique(labels, return_index=True, return_inverse=True)
    rank = np.empty(len(first), np.int64)
    rank[np.argsort(first)] = np.arange(len(first))
    number = rank[inverse.ravel()]
    corners = number[mesh.triangles]
    collapsed = (corners == np.roll(corners, 1, axis=1)).any(axis=1)
    if collapsed.any():
        face = int(np.flatnonzero(collapsed)[0])
        panel = next(name for name, rows in mesh.faces.items() if rows.start <= face < rows.stop)
        own = set(mesh.triangles[face].tolist())
        direct = [seam.name for seam in mesh.seams if any(own >= {*pair} for pair in seam.pairs.tolist())]
        what = f"The seam {direct[0]} joins" if direct else f"The seams of {panel} join"
        raise InputError(
            f"{what} two corners of one triangle of {panel} ({int(collapsed.sum())} such triangles).",
            "Mesh it finer: --size; edges that meet in a convex corner cannot be sewn to each other.",
        )
    return number


def largest_gap(positions: Floats, seam: Seam) -> float:
    """Largest distance of the two sides of a seam [m]; 0 where they are one vertex throughout."""
    if not len(seam.pairs):
        return 0.0
    ends = positions[seam.pairs]
    return float(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).max())
