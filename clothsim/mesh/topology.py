"""Topology of a triangle list: edges, interior edges with their opposite corners, borders, rings, components."""

from collections.abc import Mapping

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from clothsim.base.arrays import Ints


def unique_edges(triangles: Ints) -> Ints:
    """Return the edges of `triangles (m, 3)` as sorted pairs, (e, 2), in lexicographic order."""
    return np.unique(np.sort(half_edges(triangles), axis=1), axis=0)


def half_edges(triangles: Ints) -> Ints:
    """Return the directed edges, (3 m, 2): edge k of triangle t (from corner k to corner k+1) is row 3 t + k."""
    return triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)


def interior_edges(triangles: Ints) -> tuple[Ints, Ints]:
    """Return the edges between two triangles, as hinges.

    Edges of one triangle are borders. Edges of three or more (seams of three layers; the mesh checks reject others) are
    no hinges: no three triangles at one edge are flat in pairs, so hinges with rest angle 0 would never be at rest.

    Returns
    -------
    vertices : (h, 4) int64
        Edge start, edge end, and the corners opposite the edge in the first and in the second triangle.
    pairs : (h, 2) int64
        Those two triangles; the first runs along the edge start -> end.
    """
    directed = half_edges(triangles)
    opposite = triangles[:, [2, 0, 1]].reshape(-1)
    _, group, count = np.unique(np.sort(directed, axis=1), axis=0, return_inverse=True, return_counts=True)
    order = np.argsort(group.ravel(), kind="stable")
    starts = np.concatenate([[0], np.cumsum(count)])[:-1][count == 2]
    first, second = order[starts], order[starts + 1]
    vertices = np.column_stack([directed[first], opposite[first], opposite[second]])
    return vertices, np.column_stack([first // 3, second // 3])


def border_edges(triangles: Ints) -> tuple[Ints, Ints]:
    """Return the directed edges of exactly one triangle, (b, 2), and the half-edge `3 t + corner` of each, (b,)."""
    directed = half_edges(triangles)
    _, group, count = np.unique(np.sort(directed, axis=1), axis=0, return_inverse=True, return_counts=True)
    half = np.flatnonzero(count[group.ravel()] == 1)
    return directed[half], half


def border_vertices(triangles: Ints) -> Ints:
    """Return the sorted vertices on edges of exactly one triangle, (k,)."""
    return np.unique(border_edges(triangles)[0])


def vertex_rings(triangles: Ints, n_vertices: int) -> tuple[Ints, Ints]:
    """Return the one-ring neighbours of every vertex in compressed form.

    Ring of vertex i: `neighbours[starts[i]:starts[i + 1]]`, sorted, without i itself; `starts (n + 1,)`.
    """
    edges = unique_edges(triangles)
    both = np.concatenate([edges, edges[:, ::-1]])
    both = both[np.lexsort((both[:, 1], both[:, 0]))]
    starts = np.concatenate([[0], np.cumsum(np.bincount(both[:, 0], minlength=n_vertices))])
    return starts, both[:, 1]


def components(triangles: Ints, n_vertices: int) -> Ints:
    """Return the connected component of every vertex, (n,), numbered by first appearance; isolated vertices count."""
    edges = half_edges(triangles)
    graph = coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(n_vertices, n_vertices))
    return connected_components(graph, directed=False)[1].astype(np.int64)


def renumbered_groups(groups: Mapping[str, Ints], remaining: Ints) -> dict[str, Ints]:
    """Return the groups in the numbering of the triangles `remaining` (ascending) among themselves."""
    left = {name: np.flatnonzero(np.isin(remaining, own)) for name, own in groups.items()}
    return {name: own for name, own in left.items() if len(own)}
