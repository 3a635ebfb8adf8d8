"""Edge collapse: short edges of a half mesh merged into one vertex."""

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.mesh.topology import unique_edges, vertex_rings

SHORT = 0.5
"""An edge is short below this fraction of the mean length of the edges at its ends."""


def collapsed(positions: Floats, triangles: Ints, held: np.ndarray) -> tuple[Floats, Ints]:
    """Collapse each short edge of the half mesh where the topology stays the same.

    held (n,): border vertices, which stay; those with x = 0 are merged among themselves only. Merged ends have exactly
    two common neighbours (one, along the middle), each with more than three neighbours; no new edge joins two vertices
    of a border or of the middle; no two collapses fraction a vertex.
    """
    middle = positions[:, 0] == 0
    fixed = held | middle
    starts, neighbours = vertex_rings(triangles, len(positions))
    into = np.arange(len(positions))
    touched = np.zeros(len(positions), bool)
    for v, w in _short_edges(positions, triangles, held, middle):
        of_v, of_w = (set(neighbours[starts[k] : starts[k + 1]].tolist()) for k in (v, w))
        shared, ring = of_v & of_w, list(of_v | of_w)
        new = np.array(sorted(of_v - of_w - {w}), np.int64)
        in_middle = bool(middle[v])
        joins = fixed[w] and (fixed[new] & ~(middle[new] & in_middle)).any()
        if joins or touched[ring].any() or len(shared) != (1 if in_middle else 2):
            continue
        if all(starts[k + 1] - starts[k] > 3 for k in shared):
            into[v] = w
            touched[ring] = True
    merged = into[triangles]
    remaining = merged[(merged != np.roll(merged, 1, axis=1)).all(axis=1)]
    used, renumbered = np.unique(remaining, return_inverse=True)
    return positions[used], renumbered.reshape(-1, 3).astype(np.int64)


def _short_edges(positions: Floats, triangles: Ints, held: np.ndarray, middle: np.ndarray) -> Ints:
    """Short edges (k, 2), shortest first, each from a vertex that may be merged into the other.

    All edges of a vertex with three neighbours count: such a vertex only makes slivers.
    """
    edges = unique_edges(triangles)
    lengths = np.linalg.norm(positions[edges[:, 0]] - positions[edges[:, 1]], axis=1)
    total = np.bincount(edges.ravel(), np.repeat(lengths, 2), minlength=len(positions))
    degree = np.bincount(edges.ravel(), minlength=len(positions))
    mean = total / np.maximum(degree, 1)
    fraction = lengths / mean[edges].mean(axis=1)
    both = np.concatenate([edges, edges[:, ::-1]])
    v, w = both.T
    wanted = (np.tile(fraction, 2) < SHORT) | ((degree[v] == 3) & ~middle[v])
    short = np.flatnonzero(wanted & ~held[v] & (~middle[v] | middle[w]))
    return np.asarray(both[short[np.argsort(np.tile(fraction, 2)[short], kind="stable")]], np.int64)
