"""Manifoldness and winding: fins, bow-ties, consistent winding of orientable surfaces.

Half-edge h = 3 t + k runs from corner k of triangle t to its next corner. No triangle may contain a vertex twice.
Winding is a flood fill over edges; each component by majority, or away from a body.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order

from clothsim.base.arrays import Floats, Ints
from clothsim.base.triangles import area_vectors, connected, distinct_edges
from clothsim.mesh.topology import components, half_edges


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
    return distinct_edges(half_edges(triangles)[first[count > 2]])[0]


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
    fan = connected(left, right, len(starts))
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
    sheet = connected(left, right, 2 * m)
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


def wound(triangles: Ints, n_vertices: int) -> tuple[Ints, NDArray[np.bool_]]:
    """Return triangles wound as most of their component, and which of them were turned.

    Triangles that are not sound (indices out of range, a corner twice), and components without two sides, stay as they
    are: the mesh checks name them.

    Parameters
    ----------
    triangles : (m, 3) int64
        Vertex indices.
    n_vertices : int
        Number of vertices.

    Returns
    -------
    triangles : (m, 3) int64
        The same array where none was turned. A turned triangle has its second and third corner swapped.
    turned : (m,) bool

    Examples
    --------
    >>> wound(np.array([[0, 1, 2], [2, 1, 3], [2, 4, 3]]), 5)[1].tolist()
    [False, False, True]
    """
    turned = np.zeros(len(triangles), bool)
    sound = ((triangles >= 0) & (triangles < n_vertices)).all(axis=1)
    sound &= (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
    rows = np.flatnonzero(sound)
    if len(rows):
        own = triangles[rows]
        turned[rows[turned_triangles(own, joined_half_edges(own))[0]]] = True
    return (_swapped(triangles, turned) if turned.any() else triangles), turned


def facing_away(positions: Floats, triangles: Ints, body: Floats, turned: NDArray[np.bool_]) -> Ints:
    """Return triangles in which each component with a turned triangle faces away from a body.

    Parameters
    ----------
    positions : (n, 3) float64
        Vertices [m].
    triangles : (m, 3) int64
        Consistently wound.
    body : (k, 3) float64
        Vertices of the body [m]: the area that faces away from the nearest of them decides.
    turned : (m,) bool
        Triangles that `wound` turned.
    """
    from scipy.spatial import cKDTree

    corners = positions[triangles]
    areas = area_vectors(corners)
    centres = corners.mean(axis=1)
    away = centres - body[cKDTree(body).query(centres)[1]]
    distance = np.linalg.norm(away, axis=1, keepdims=True)
    outward = np.einsum("ij,ij->i", areas, away / np.where(distance > 0, distance, 1.0))
    piece = components(triangles, len(positions))[triangles[:, 0]]
    inwards = np.bincount(piece, outward)[piece] < 0
    changed = np.bincount(piece, turned)[piece] > 0
    return _swapped(triangles, inwards & changed)


def _swapped(triangles: Ints, chosen: NDArray[np.bool_]) -> Ints:
    return np.where(chosen[:, None], triangles[:, [0, 2, 1]], triangles)
