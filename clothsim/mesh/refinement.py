"""Interpolating refinement of a triangle mesh: a smooth surface through its vertices, linear in them.

Each edge gets a new vertex by the rules of Zorin, Schroeder & Sweldens 1996, "Interpolating subdivision for meshes with
arbitrary topology": about each end the surface is taken as a quadratic of its ring. On the border it is the four-point
curve (Dyn, Levin & Gregory 1987), so that both sides of a fold of triangles of size h lie within about h^4 of the
smooth surface, where a polygon lies h^2/(8 R) inside of a radius R.
"""

import numpy as np
from scipy.sparse import coo_array, csr_array, eye_array

from clothsim.base.arrays import Floats, Ints
from clothsim.base.triangles import distinct_edges, half_edges

LEAST_FAN = 3
"""Triangles at a vertex of the border from which on the curve passes it smoothly; fewer: it is a corner."""


def refined(triangles: Ints, n_vertices: int, times: int = 1) -> tuple[csr_array, Ints]:
    """Return the vertices of a refined mesh as combinations of the old ones, (k, n), and its triangles.

    Parameters
    ----------
    triangles : (m, 3) int64
        Of the mesh.
    n_vertices : int
        Its number of vertices.
    times : int
        Refinements; each makes four triangles of one, 4 t to 4 t + 3 of triangle t.

    Examples
    --------
    >>> from clothsim.mesh.generators.shapes import disk
    >>> flat, triangles = disk(1.0, 4)
    >>> weights, finer = refined(triangles, len(flat))
    >>> bowl = flat[:, 0] ** 2
    >>> len(finer) == 4 * len(triangles), bool(abs((weights @ bowl)[: len(flat)] - bowl).max() < 1e-15)
    (True, True)
    """
    weights, fine = csr_array(eye_array(n_vertices)), triangles
    for _ in range(times):
        once, fine = _once(fine, weights.shape[0])
        weights = csr_array(once @ weights)
    return weights, fine


def _once(triangles: Ints, n: int) -> tuple[csr_array, Ints]:
    ends = half_edges(triangles)
    pairs, edge, _ = distinct_edges(ends)
    rows, columns, values = _rules(ends, edge, len(pairs), n)
    new = coo_array((values, (rows, columns)), shape=(len(pairs), n))
    total = np.asarray(new.sum(axis=1)).ravel()
    lonely = np.flatnonzero(total == 0.0)  # an inner edge between two vertices of the border: its middle
    middles = coo_array((np.full(2 * len(lonely), 0.5), (np.repeat(lonely, 2), pairs[lonely].ravel())), shape=new.shape)
    ab, bc, ca = (n + edge.reshape(-1, 3)[:, k] for k in range(3))
    a, b, c = triangles.T
    fine = np.stack([a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca], axis=1).reshape(-1, 3)
    upper = eye_array(n).tocoo()
    lower = (new + middles).tocoo()
    joined = coo_array(
        (
            np.concatenate([upper.data, lower.data]),
            (np.concatenate([upper.row, n + lower.row]), np.concatenate([upper.col, lower.col])),
        ),
        shape=(n + len(pairs), n),
    )
    return csr_array(joined), fine


def _rules(ends: Ints, edge: Ints, n_edges: int, n: int) -> tuple[Ints, Ints, Floats]:
    """Entries (row, column, weight) of the new vertices of edges that have a rule."""
    # the half-edge on the other side, -1 where there is none, or more than one, or it runs alike
    uses = np.bincount(edge, minlength=n_edges)
    first = np.concatenate([[0], np.cumsum(uses)])[:-1][uses == 2]
    order, opposite = np.argsort(edge, kind="stable"), np.full(len(ends), -1)
    a, b = order[first], order[first + 1]
    against = ends[a, 0] == ends[b, 1]
    opposite[a[against]], opposite[b[against]] = b[against], a[against]
    on_border = np.zeros(n, bool)
    on_border[ends[opposite < 0].ravel()] = True
    fan = np.bincount(ends[:, 0], minlength=n)
    before = np.arange(len(ends)) // 3 * 3 + (np.arange(len(ends)) + 2) % 3
    following = opposite[before]  # the next spoke about the start of a half-edge
    inner = ~on_border[ends[:, 0]]
    shared = np.where(inner & ~on_border[ends[:, 1]], 0.5, 1.0)
    parts = [(edge[inner], ends[inner, 0], 0.75 * shared[inner])]  # of a vertex in the new vertices of its spokes
    spoke = np.flatnonzero(inner)
    at = spoke.copy()
    for k in range(int(fan[ends[spoke, 0]].max(initial=0))):
        counts = fan[ends[spoke, 0]]
        live = k < counts
        turn = 2 * np.pi * k / counts[live]  # of the k-th neighbour, from the one at the other end of the edge
        weight = (0.25 + np.cos(turn) + 0.5 * np.cos(2 * turn)) / counts[live]
        weight = np.where(counts[live] == 4, (3 / 8, 0.0, -1 / 8, 0.0)[k % 4], weight)
        weight = np.where(counts[live] == 3, 5 / 12 if k == 0 else -1 / 12, weight)
        parts.append((edge[spoke[live]], ends[at[live], 1], shared[spoke[live]] * weight))
        at = following[at]
    border = np.flatnonzero(opposite < 0)
    number_in, number_out = (np.bincount(ends[border, k], minlength=n) for k in (1, 0))
    smooth = (number_in == 1) & (number_out == 1) & (fan >= LEAST_FAN)
    previous, following_vertex = np.zeros(n, np.int64), np.zeros(n, np.int64)
    previous[ends[border, 1]], following_vertex[ends[border, 0]] = ends[border, 0], ends[border, 1]
    for k in (0, 1):
        i = ends[border, k]
        round_ = smooth[i].astype(np.float64)  # half of an end, less an eighth of the mean of its neighbours from it
        parts.append((edge[border], i, 0.5 + 0.125 * round_))
        parts += [(edge[border], near[i], -0.0625 * round_) for near in (previous, following_vertex)]
    return tuple(np.concatenate(each) for each in zip(*parts, strict=True))  # type: ignore[return-value]
