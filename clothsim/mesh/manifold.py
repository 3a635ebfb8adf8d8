"""Manifold checks: non-manifold edges (fins) and vertices (bow-ties), inconsistent winding, in whole arrays.

Half-edge h = 3 t + k runs from corner k of triangle t to its next corner. No triangle may contain a vertex twice.
"""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order, connected_components

from clothsim.base.arrays import Ints
from clothsim.mesh.topology import half_edges


def joined_half_edges(triangles: Ints) -> tuple[Ints, Ints, Ints]:
    """Return pairs of half-edges over the same two vertices: first (p,), second (p,), and their number, count (p,).

    An edge of n triangles gives n - 1 pairs, a chain through all of them.
    """
    ends = np.sort(half_edges(triangles), axis=1)
    key = ends[:, 0] * (ends.max(initial=0) + 1) + ends[:, 1]
    order = np.argsort(key, kind="stable")
    starts = np.flatnonzero(np.diff(key[order], prepend=-1))
    sizes = np.diff(starts, append=len(order))
    same = np.ones(len(order), bool)
    same[starts] = False
    second = np.flatnonzero(same)
    return order[second - 1], order[second], np.repeat(sizes, sizes)[second]


def fin_edges(triangles: Ints, joined: tuple[Ints, Ints, Ints]) -> Ints:
    """Return the edges of three or more triangles, as sorted pairs of vertices (k, 2)."""
    first, _, count = joined
    return np.unique(np.sort(half_edges(triangles)[first[count > 2]], axis=1), axis=0)


def bow_tie_vertices(triangles: Ints, joined: tuple[Ints, Ints, Ints], n_vertices: int) -> Ints:
    """Return the vertices whose triangles form more than one fan, sorted (k,).

    Two corners at one vertex are in one fan where their triangles share an edge there.
    """
    first, second, _ = joined
    starts = triangles.ravel()
    turned = starts[first] != starts[second]
    first_end, second_end = _next_corner(first), _next_corner(second)
    left = np.concatenate([first, first_end])
    right = np.concatenate([np.where(turned, second_end, second), np.where(turned, second, second_end)])
    fan = _connected(left, right, len(starts))
    _, one_corner = np.unique(fan, return_index=True)
    fans = np.bincount(starts[one_corner], minlength=n_vertices)
    return np.flatnonzero(fans > 1)


def turned_triangles(triangles: Ints, joined: tuple[Ints, Ints, Ints]) -> tuple[Ints, Ints]:
    """Return triangles with inconsistent winding, and those of non-orientable components (a Moebius strip), sorted.

    Every triangle is taken twice, as it is and reversed; across each edge of two triangles the copies with consistent
    winding are joined. An orientable component splits into two sheets: the reversed triangles are the minority in the
    first.
    """
    first, second, count = joined
    pair = count == 2
    first, second = first[pair], second[pair]
    starts = triangles.ravel()
    disagree = starts[first] == starts[second]
    m, one, two = len(triangles), first // 3, second // 3
    left = np.concatenate([one, one + m])
    right = np.concatenate([np.where(disagree, two + m, two), np.where(disagree, two, two + m)])
    sheet = _connected(left, right, 2 * m)
    as_is, over = sheet[:m], sheet[m:]
    one_sided = as_is == over
    _, piece = np.unique(np.minimum(as_is, over), return_inverse=True)
    turned = as_is > over
    size, turned_size = np.bincount(piece), np.bincount(piece, weights=turned)
    mostly_turned = (2 * turned_size > size)[piece]
    return np.flatnonzero((turned != mostly_turned) & ~one_sided), np.flatnonzero(one_sided)


def one_sided_edge(triangles: Ints, joined: tuple[Ints, Ints, Ints]) -> Ints:
    """Return an edge (2,) of a non-orientable component whose triangles disagree after a flood fill of the others."""
    first, second, count = joined
    first, second = first[count == 2], second[count == 2]
    starts, m = triangles.ravel(), len(triangles)
    one, two, disagree = first // 3, second // 3, starts[first] == starts[second]
    graph = coo_array((np.ones(len(one)), (one, two)), shape=(m, m)).tocsr()
    sign_of = dict(zip(zip(one.tolist(), two.tolist(), strict=True), disagree.tolist(), strict=True))
    _, one_sided = turned_triangles(triangles, joined)
    order, before = breadth_first_order(graph, one_sided[0], directed=False)
    turned, filled = np.zeros(m, bool), np.zeros(m, bool)
    filled[order] = True
    for triangle in order[1:].tolist():
        previous = int(before[triangle])
        over = sign_of.get((previous, triangle), sign_of.get((triangle, previous), False))
        turned[triangle] = turned[previous] ^ over
    wrong = np.flatnonzero(filled[one] & ((turned[one] ^ turned[two]) != disagree))
    return np.sort(half_edges(triangles)[first[wrong[0]]])


def _next_corner(half_edge: Ints) -> Ints:
    return half_edge - half_edge % 3 + (half_edge % 3 + 1) % 3


def _connected(left: Ints, right: Ints, size: int) -> Ints:
    """Component of each of `size` nodes of which left[i] and right[i] are joined."""
    graph = coo_array((np.ones(len(left), np.int8), (left, right)), shape=(size, size))
    return connected_components(graph, directed=False)[1].astype(np.int64)
