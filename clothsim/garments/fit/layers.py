"""Layers of a garment: which piece is worn over which, by their distances from the body where they overlap."""

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.engine import components

OVERLAP = 0.02
"""Distance within which vertices of two pieces overlap [m]."""
CLEARLY = 0.7
"""Least fraction of the overlapping vertices of a piece that are farther out, for it to be the outer one."""
MOST = 50
"""Pieces, the largest by number of vertices, that are ordered."""


def layers_of(positions: Floats, triangles: Ints, distances: Floats) -> Ints:
    """Return the layer of each vertex, (n,): larger farther out; the same for pieces that no overlap orders.

    Parameters
    ----------
    positions : (n, 3) float64
        Garment as it is worn [m].
    triangles : (m, 3) int64
        Its triangles.
    distances : (n,) float64
        Signed distances of the vertices from the body, negative inside [m].
    """
    from scipy.spatial import cKDTree

    piece = components(triangles, len(positions))
    largest = np.argsort(-np.bincount(piece), kind="stable")[:MOST]
    rows = [np.flatnonzero(piece == number) for number in largest]
    trees = [cKDTree(positions[own]) for own in rows]
    over: list[tuple[int, int]] = []
    for a in range(len(rows)):
        for b in range(len(rows)):
            if a == b:
                continue
            gap, nearest = trees[b].query(positions[rows[a]], distance_upper_bound=OVERLAP)
            met = np.flatnonzero(np.isfinite(gap))
            if len(met):
                farther = distances[rows[a][met]] > distances[rows[b][nearest[met]]]
                if farther.mean() >= CLEARLY:
                    over.append((a, b))
    # both ways: two pieces that cross are not ordered
    over = [pair for pair in over if pair[::-1] not in over]
    level = np.zeros(len(rows), np.int64)
    for _ in rows:  # a circle of pieces, each over the next, ends here
        for a, b in over:
            level[a] = max(level[a], min(level[b] + 1, len(rows)))
    layer = np.zeros(len(positions), np.int64)
    for own, number in zip(rows, level, strict=True):
        layer[own] = number
    return layer
