"""Topology of a triangle list: edges, borders, rings, components, degenerate and duplicate triangles."""

from collections.abc import Mapping

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.triangles import border_edges, connected, distinct_edges, half_edges, unique_edges


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
    _, row, count = distinct_edges(directed)
    order = np.argsort(row, kind="stable")
    starts = np.concatenate([[0], np.cumsum(count)])[:-1][count == 2]
    first, second = order[starts], order[starts + 1]
    vertices = np.column_stack([directed[first], opposite[first], opposite[second]])
    return vertices, np.column_stack([first // 3, second // 3])


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
    return connected(edges[:, 0], edges[:, 1], n_vertices)


def renumbered_groups(groups: Mapping[str, Ints], remaining: Ints) -> dict[str, Ints]:
    """Return the groups in the numbering of the triangles `remaining` (ascending) among themselves."""
    left = {name: np.flatnonzero(np.isin(remaining, own)) for name, own in groups.items()}
    return {name: own for name, own in left.items() if len(own)}


def flat_triangles(positions: Floats, triangles: Ints) -> Ints:
    """Find the triangles without area, (k,): needles of zero length and collinear corners.

    |e1 x e2| <= 1e-14 L^2 + 4 ulp(|x|) L with L the longest edge: no absolute length, so millimetres and kilometres are
    treated alike, and far from the origin a triangle that is only round-off is degenerate. Slivers of aspect ratio 1e7
    are not.
    """
    corners = positions[triangles]
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        edge1, edge2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        longest = np.abs(np.stack([edge1, edge2, edge2 - edge1])).max(axis=(0, 2))
        sine = np.linalg.norm(np.cross(edge1 / longest[:, None], edge2 / longest[:, None]), axis=1)
        noise = 4 * np.finfo(float).eps * np.abs(corners).max(axis=(1, 2)) / longest
        return np.flatnonzero(~(sine > 1e-14 + noise))


def duplicates(triangles: Ints) -> tuple[Ints, Ints]:
    """Find the triangles that repeat an earlier one, with the same and with the opposite winding: two sorted (k,)."""
    smallest = np.argmin(triangles, axis=1)
    rolled = np.take_along_axis(triangles, (smallest[:, None] + np.arange(3)) % 3, axis=1)
    odd = rolled[:, 1] > rolled[:, 2]
    low, high = rolled[:, 1:].min(axis=1), rolled[:, 1:].max(axis=1)
    order = np.lexsort((high, low, rolled[:, 0]))
    key = np.column_stack([rolled[:, 0], low, high])[order]
    new = np.ones(len(order), bool)
    new[1:] = (key[1:] != key[:-1]).any(axis=1)
    original = order[new][np.cumsum(new) - 1]
    repeats, original = order[~new], original[~new]
    same = odd[repeats] == odd[original]
    return np.sort(repeats[same]), np.sort(repeats[~same])


def coincidence(positions: Floats) -> tuple[Ints, Ints]:
    """Group vertices by position (exactly equal): the group of each vertex (n,) and the size of that group (n,)."""
    order = np.lexsort(positions.T)
    new = np.ones(len(order), bool)
    new[1:] = (positions[order[1:]] != positions[order[:-1]]).any(axis=1)
    group = np.empty(len(order), np.int64)
    group[order] = np.cumsum(new) - 1
    return group, np.bincount(group)[group]
