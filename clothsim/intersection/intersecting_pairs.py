"""The intersecting pairs of triangles of one or two surfaces, exact, and where they are."""

import numpy as np

from clothsim.arrays import Floats, Ints, as_points, as_triangles
from clothsim.errors import InputError
from clothsim.intersection.box_tree import boxes, overlapping, tree
from clothsim.intersection.predicates import scaled
from clothsim.intersection.triangle_pair import triangles_intersect
from clothsim.jit import kernel, part

LIMIT = 1_000_000


def intersecting_pairs(positions: Floats, first: Ints, second: Ints | None = None, limit: int = LIMIT) -> Ints:
    """The pairs (i, j) of triangles that intersect: `first[i]` and `second[j]`, (p, 2), sorted.

    positions: (n, 3) in any one unit; first: (m, 3); second: (k, 3), or None: first with itself, i < j. Closed
    triangles; those that share vertices intersect where they meet elsewhere (see `triangles`). limit: the search ends
    with that many pairs; 1 answers "any?". InputError for bad arrays.
    """
    if limit < 1:
        raise InputError(f"limit must be at least 1, not {limit}.")
    x = as_points("positions", positions)
    one = as_triangles("first", first, len(x))
    two = one if second is None else as_triangles("second", second, len(x))
    if not len(one) or not len(two):
        return np.zeros((0, 2), np.int64)
    pairs = np.asarray(_pairs(scaled(x), one, two, second is None, limit), np.int64)
    return pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]


def intersection_points(positions: Floats, first: Ints, second: Ints, pairs: Ints) -> Floats:
    """A point near each intersection, (p, 3): the centre of what the boxes of its two triangles have in common."""
    one, two = positions[first[pairs[:, 0]]], positions[second[pairs[:, 1]]]
    low = np.maximum(one.min(axis=1), two.min(axis=1))
    high = np.minimum(one.max(axis=1), two.max(axis=1))
    return np.asarray(0.5 * (low + high), np.float64)


@kernel
def _pairs(x, first, second, with_itself, limit):
    """Triangle by triangle of `first`: a box search among `second`, then the exact test."""
    lower, upper = boxes(x, second)
    order, nodes = tree(lower, upper)
    low, high = boxes(x, first)
    hits = np.empty(len(second), np.int64)
    found, count = np.empty((64, 2), np.int64), 0
    for i in range(len(first)):
        s = (first[i, 0], first[i, 1], first[i, 2])
        for j in hits[: overlapping(order, nodes, lower, upper, low[i], high[i], hits)]:
            if with_itself and j <= i:
                continue
            if triangles_intersect(x, s, (second[j, 0], second[j, 1], second[j, 2])):
                if count == len(found):
                    found = _twice_as_long(found)
                found[count, 0], found[count, 1] = i, j
                count += 1
                if count == limit:
                    return found[:count]
    return found[:count]


@part
def _twice_as_long(found):
    longer = np.empty((2 * len(found), 2), np.int64)
    for k in range(len(found)):
        longer[k, 0], longer[k, 1] = found[k]
    return longer
