"""Corresponding landmarks of two upright human bodies from geodesic distances.

A body is a star of five limbs: its tips (head, hands, feet) are the points farthest from its middle along the surface,
and its bends (crotch, armpits) are where the shortest path along the surface from one tip to the next
is farthest from their chord. Both survive a change of shape and, mostly, of pose. The bodies stand in the same axes and
face the same way.
"""

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from transfer.errors import TransferError
from transfer.triangle_surface import Floats, Ints, edges_of

TIPS = 5


def derive_markers(source: tuple[Floats, Ints], target: tuple[Floats, Ints]) -> Ints:
    """Corresponding vertices of two bodies.

    Tips are matched by their positions in the bounding boxes, bends by the tips that they lie between.

    Parameters
    ----------
    source, target : tuple of ndarray
        Positions (n, 3) [m] and triangles (m, 3) of one connected component.

    Returns
    -------
    ndarray (k, 2)
        (source vertex, target vertex).

    Raises
    ------
    TransferError
        The surface has fewer than five limbs.
    """
    vertices, predecessors, _ = zip(*(tips(*mesh) for mesh in (source, target)), strict=True)
    in_boxes = [in_box(*mesh)[own] for mesh, own in zip((source, target), vertices, strict=True)]
    distance = np.linalg.norm(in_boxes[0][:, None] - in_boxes[1][None], axis=2)
    _, match = linear_sum_assignment(distance)
    markers = [(vertices[0][i], vertices[1][match[i]]) for i in range(TIPS)]
    for i, j in limb_pairs(in_boxes[0]):
        bends = (
            bend(source[0], predecessors[0][i], vertices[0][i], vertices[0][j]),
            bend(target[0], predecessors[1][match[i]], vertices[1][match[i]], vertices[1][match[j]]),
        )
        markers.append(bends)
    pairs = np.array(markers, dtype=np.int64)
    once = [len(np.unique(pairs[:, side])) == len(pairs) for side in (0, 1)]
    return pairs if all(once) else pairs[:TIPS]


def in_box(positions: Floats, triangles: Ints) -> Floats:
    """Positions scaled so that the bounding box is centred at 0 with largest side 1."""
    used = positions[np.unique(triangles)]
    low, high = used.min(axis=0), used.max(axis=0)
    return (positions - (low + high) / 2.0) / (high - low).max()


def tips(positions: Floats, triangles: Ints) -> tuple[Ints, list[Ints], list[Floats]]:
    """Five tips, the head last, and for each the predecessors (n,) and lengths (n,) of the shortest paths to it.

    The head is the tip nearest to the four others.

    Farthest-point sampling among local maxima of the distance from the middle: a knee is none.
    """
    graph = edge_graph(positions, triangles)
    used = np.unique(triangles)
    middle = positions[used].mean(axis=0)
    start = used[np.linalg.norm(positions[used] - middle, axis=1).argmin()]
    from_middle = dijkstra(graph, directed=False, indices=start)
    peaks = np.where(np.isfinite(from_middle), from_middle, -1.0)
    for ends in (edges_of(triangles), edges_of(triangles)[:, ::-1]):
        peaks[ends[from_middle[ends[:, 0]] < from_middle[ends[:, 1]], 0]] = -1.0
    distance = from_middle
    extremes, predecessors, distances = [], [], []
    for _ in range(TIPS):
        extremes.append(int(np.where(peaks > 0, distance, -1.0).argmax()))
        if peaks[extremes[-1]] <= 0 or distance[extremes[-1]] == 0:
            raise TransferError(
                f"the surface has {len(extremes) - 1} limbs where a body has {TIPS}.", "Give the markers."
            )
        own, predecessor = dijkstra(graph, directed=False, indices=extremes[-1], return_predecessors=True)
        predecessors.append(predecessor)
        distances.append(own)
        distance = np.minimum(distance, own)
    order = np.argsort(-np.array(distances)[:, extremes].sum(axis=1))
    return np.array(extremes)[order], [predecessors[k] for k in order], [distances[k] for k in order]


def edge_graph(positions: Floats, triangles: Ints) -> csr_array:
    """Sparse matrix of edge lengths, (n, n) [m]."""
    edges = edges_of(triangles)
    lengths = np.linalg.norm(positions[edges[:, 0]] - positions[edges[:, 1]], axis=1)
    return csr_array((lengths, (edges[:, 0], edges[:, 1])), shape=(len(positions), len(positions)))


def limb_pairs(points: Floats) -> list[tuple[int, int]]:
    """Three pairs of hands and feet adjacent by angle in the body's widest plane.

    The pairs with the head, the last, are left out: the shortest path past a neck runs in front of one body and
    at the side of the next.
    """
    centred = points - points.mean(axis=0)
    axes = np.linalg.svd(centred, full_matrices=False)[2]
    order = np.argsort(np.arctan2(centred @ axes[1], centred @ axes[0]))
    pairs = [(int(order[k]), int(order[(k + 1) % len(order)])) for k in range(len(order))]
    return [pair for pair in pairs if len(points) - 1 not in pair]


def bend(positions: Floats, predecessors: Ints, tip: int, other: int) -> int:
    """Vertex of the shortest path from `other` to `tip` that is farthest from the straight line between them."""
    path = [other]
    while path[-1] != tip and len(path) <= len(predecessors):
        path.append(int(predecessors[path[-1]]))
    points = positions[path]
    chord = points[-1] - points[0]
    along = (points - points[0]) @ chord / (chord @ chord)
    return path[int(np.linalg.norm(points - points[0] - along[:, None] * chord, axis=1).argmax())]
