"""Intersection contours, and the two curves that each makes on the surfaces (Baraff, Witkin & Kass 2003, section 4).

Two triangles intersect in a segment; segments that end in the same piercing are joined, and make a contour. On the
surfaces a contour is two curves, one on either side of each segment; where neighbours pass through one another the two
meet in the vertex that they share, and are one.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from clothsim.base.arrays import Ints
from clothsim.geometry.untangling.piercings import Piercings


@dataclass(frozen=True)
class Contours:
    """Contours and curves of a set of piercings.

    Parameters
    ----------
    contour : (k,) int64
        Contour of each piercing.
    edge_curve, face_curve : (k,) int64
        Curve on the surface of its edge, which cuts the edge, and on that of its triangle, which passes inside.
    n_contours, n_curves : int
        Their numbers.
    contour_of_curve : (n_curves,) int64
        Contour that each curve is of; -1 for one without a piercing.
    """

    contour: Ints
    edge_curve: Ints
    face_curve: Ints
    n_contours: int
    n_curves: int
    contour_of_curve: Ints


def contours(found: Piercings, n_pairs: int) -> Contours:
    """Return the contours of piercings of `n_pairs` pairs of triangles."""
    piercing, pair, role = found.of_pair.T
    k = len(found.edges)
    contour = connected(piercing, k + pair, k + n_pairs)[:k]
    # a node (pair, role) is a segment on one of its two surfaces; those at one piercing continue one another
    order = np.argsort(piercing, kind="stable")
    same = np.diff(piercing[order]) == 0
    one, other = order[:-1][same], order[1:][same]
    own, opposite = 2 * pair + role, 2 * pair + 1 - role
    curve = connected(
        np.concatenate([own[one], opposite[one]]), np.concatenate([own[other], opposite[other]]), 2 * n_pairs
    )
    first = np.zeros(k, np.int64)
    first[piercing[::-1]] = np.arange(len(piercing))[::-1]
    edge_curve, face_curve = curve[own[first]], curve[opposite[first]]
    n_curves = int(curve.max(initial=-1)) + 1
    of_curve = np.full(n_curves, -1)
    of_curve[edge_curve], of_curve[face_curve] = contour, contour
    numbers, dense = np.unique(contour, return_inverse=True)
    of_curve[of_curve >= 0] = np.searchsorted(numbers, of_curve[of_curve >= 0])
    return Contours(dense.ravel(), edge_curve, face_curve, len(numbers), n_curves, of_curve)


def connected(left: Ints, right: Ints, n: int) -> Ints:
    """Return the connected component of each of n nodes of an undirected graph."""
    graph = coo_array((np.ones(len(left)), (left, right)), shape=(n, n))
    return connected_components(graph, directed=False)[1].astype(np.int64)
