"""Exact intersecting triangle pairs of one or two surfaces, and points near them."""

import numpy as np

from clothsim.base.arrays import Floats, Ints, as_points, as_triangles
from clothsim.base.errors import InputError
from clothsim.base.jit import kernel, part
from clothsim.geometry.intersection.box_tree import STACK, boxes, leaf_range, next_leaves, rows_overlap, tree, within
from clothsim.geometry.intersection.predicates import scaled
from clothsim.geometry.intersection.triangle_pair import triangles_intersect

LIMIT = 1_000_000
"""Default number of pairs at which a search ends."""


def intersecting_pairs(positions: Floats, first: Ints, second: Ints | None = None, limit: int = LIMIT) -> Ints:
    """Pairs of triangles that intersect, by exact predicates.

    Triangles are closed. Those with common vertices intersect where they meet elsewhere (`triangle_pair`).

    Parameters
    ----------
    positions : (n, 3) array
        Vertex positions, in any one unit.
    first : (m, 3) int array
        Triangles of the first surface.
    second : (k, 3) int array, optional
        Triangles of the second surface; None: the first with itself, i < j.
    limit : int
        Number of pairs at which the search ends; 1 answers "any?".

    Returns
    -------
    (p, 2) int array
        `first[i]` and `second[j]`, sorted.

    Raises
    ------
    InputError
        Arrays with wrong shapes, non-finite entries or rows out of range; a limit below 1.

    Examples
    --------
    >>> import numpy as np
    >>> x = np.array([[0.0, 0, 0], [4, 0, 0], [0, 4, 0], [1, 1, -1], [1, 1, 1], [9, 9, 0]])
    >>> intersecting_pairs(x, np.array([[0, 1, 2]]), np.array([[3, 4, 5]]))
    array([[0, 0]])
    """
    if limit < 1:
        raise InputError(f"limit must be at least 1, not {limit}.")
    x = as_points("positions", positions)
    first_rows = as_triangles("first", first, len(x))
    second_rows = first_rows if second is None else as_triangles("second", second, len(x))
    if not len(first_rows) or not len(second_rows):
        return np.zeros((0, 2), np.int64)
    pairs = np.asarray(_pairs(scaled(x), first_rows, second_rows, second is None, limit), np.int64)
    return pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]


def intersection_points(positions: Floats, first: Ints, second: Ints, pairs: Ints) -> Floats:
    """A point near each intersection: the centre of the overlap of the two triangles' boxes.

    Parameters
    ----------
    positions : (n, 3) array
        Vertex positions.
    first, second : (m, 3), (k, 3) int array
        Triangles of both surfaces.
    pairs : (p, 2) int array
        Pairs from `intersecting_pairs`.

    Returns
    -------
    (p, 3) array
        Points in the unit of the positions.
    """
    one, other = positions[first[pairs[:, 0]]], positions[second[pairs[:, 1]]]
    low = np.maximum(one.min(axis=1), other.min(axis=1))
    high = np.minimum(one.max(axis=1), other.max(axis=1))
    return np.asarray(0.5 * (low + high), np.float64)


@kernel
def _pairs(x, first, second, self_test, limit):
    """Traverse the box trees of both surfaces, then test the triangles of leaves that overlap exactly."""
    all_first, all_second = boxes(x, first), boxes(x, second)
    rows, nodes, low, high = _sorted_near(all_first, all_second)
    others, other_nodes, lower, upper = rows, nodes, low, high
    if not self_test:
        others, other_nodes, lower, upper = _sorted_near(all_second, all_first)
    stack, n_waiting = np.ones((STACK, 2), np.int64), 1
    found, count = np.empty((64, 2), np.int64), 0
    while True:
        n_waiting, a, b = next_leaves(stack, n_waiting, nodes, other_nodes, self_test)
        if a == 0:
            return found[:count]
        start, stop = leaf_range(len(rows), nodes, a)
        other_start, other_stop = leaf_range(len(others), other_nodes, b)
        for p in range(start, stop):
            for q in range(p + 1 if self_test and a == b else other_start, other_stop):
                if not rows_overlap(low, high, p, lower, upper, q):
                    continue
                i, j = rows[p], others[q]
                if self_test and j < i:
                    i, j = j, i
                s, t = (first[i, 0], first[i, 1], first[i, 2]), (second[j, 0], second[j, 1], second[j, 2])
                if not triangles_intersect(x, s, t):
                    continue
                if count == len(found):
                    found = _doubled(found)
                found[count, 0], found[count, 1] = i, j
                count += 1
                if count == limit:
                    return found[:count]


@part
def _sorted_near(surface, other):
    """The tree over the boxes of a surface that overlap the box of the other: triangles in its order, nodes, boxes."""
    (low, high), (lower, upper) = surface, other
    near = within(low, high, lower, upper)
    order, nodes = tree(low[near], high[near])
    rows = near[order]
    return rows, nodes, low[rows], high[rows]


@part
def _doubled(found):
    """A copy with twice the capacity."""
    copy = np.empty((2 * len(found), 2), np.int64)
    for k in range(len(found)):
        copy[k, 0], copy[k, 1] = found[k]
    return copy
