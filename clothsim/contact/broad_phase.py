"""Which elements of two trees may meet on a way: those whose boxes overlap, less those that the way keeps apart.

Overlap is closed: boxes that touch overlap. Which pairs are found depends on the elements alone, their order on the
trees. Four boxes walk through the other tree as one, to the fours that they meet; there box is compared with box. Most
pairs found so are neighbours in one cloth: they are told apart at once, and never listed.
"""

import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.contact.bvh import FOUR, BoxTree
from clothsim.contact.culling import ROUNDING, are_kept_apart, corners, distance_if_near, rows_of, share_a_vertex
from clothsim.contact.simd_boxes import that_overlap
from clothsim.contact.traversal import DEPTH, fours_met, gathered
from clothsim.jit import kernel, part

Met = tuple[Ints, Ints, Floats]
"""The first and the second of each pair, and how far apart they are [m], (p,) each."""


def that_may_meet(
    first: BoxTree,
    second: BoxTree,
    grown: float,
    labels: Ints,
    allowed: np.ndarray,
    before: Floats,
    after: Floats,
    distance: float,
    of: np.ndarray | None = None,
    but: np.ndarray | None = None,
) -> Met:
    """Elements i of the one, with boxes grown by `grown` [m] on each side, and j of the other tree that may meet.

    Points and triangles, triangles and points, or edges; of one and the same tree, i < j. The boxes overlap, and the
    elements may come nearer than `distance` [m] on the way before -> after (N, 3) [m]; labels (N,), allowed (L, L):
    which objects may touch. Pairs that share a vertex are left out. of (N,): only those i that hang on one of these
    rows of x, or such j in one and the same tree; but (N,): none of those j.
    """
    itself, whole = first is second, of is None and but is None
    if first.elements.shape[1] == 3:
        allowed = np.ascontiguousarray(allowed.T)
    way = labels, allowed, before, after, distance
    turned = whole and len(second.order) < len(first.order)  # what is asked, walks: let the fewer
    mine, theirs = (second, first) if turned else (first, second)
    asked = np.ones(len(mine.order), bool) if of is None else mine.hanging(of)
    left_out = asked  # of one and the same tree: a pair of two that are asked is met twice
    if not itself:
        left_out = np.zeros(len(theirs.order), bool) if but is None else theirs.hanging(but)
    ours = mine.boxes, mine.elements, mine.order, asked
    other = theirs.boxes, theirs.elements, theirs.order, left_out, theirs.starts
    points_second = (first.elements.shape[1] == 3) != turned
    found = _that_may_meet(*ours, *other, grown, itself, itself and whole, points_second, *way)
    return (found[1], found[0], found[2]) if turned else found


@kernel
def _that_may_meet(
    boxes_a: Floats,
    elements_a: Ints,
    order_a: Ints,
    asked: np.ndarray,
    boxes: Floats,
    elements: Ints,
    order: Ints,
    left_out: np.ndarray,
    starts: Ints,
    grown: float,
    itself: bool,
    later: bool,
    turned: bool,
    labels: Ints,
    allowed: np.ndarray,
    before: Floats,
    after: Floats,
    distance: float,
) -> tuple[Ints, Ints, Floats]:
    """The elements of two trees; asked (m,): which i, by their places in the leaves; left_out: which j.

    itself: of a tree with itself, the smaller first, and j is left out only where it comes before i; later: all are
    asked, and only j from the four of i on is looked at; turned: j comes before i in a pair's rows.
    """
    is_edges, squared = elements.shape[1] == 2, (distance * ROUNDING) ** 2
    group, whole, stack = np.empty((FOUR, 6)), np.empty(6), np.empty(DEPTH, np.int64)
    met, near = np.empty(starts[1] + FOUR, np.int64), np.empty(FOUR * FOUR * (starts[1] + 1), np.int64)
    found, distances, count = np.empty(1024, np.int64), np.empty(1024), 0
    for four in range((len(asked) + FOUR - 1) // FOUR):
        if not gathered(four, boxes_a, asked, grown, group, whole):
            continue
        n_met = fours_met(whole, four, boxes, starts, later, stack, met)
        n_near = _overlapping(four, group, boxes, met, n_met, near)
        n_near = _strangers(near, n_near, elements_a, elements, left_out, itself, turned, is_edges)
        if count + n_near > len(found):
            size = 2 * (count + n_near)
            found, distances = _longer(found, count, size), _longer(distances, count, size)
        for n in range(n_near):
            i, j = near[n] >> 32, near[n] & 0xFFFFFFFF
            one, other = order_a[i], order[j]
            swapped = itself and other < one
            rows = _rows(elements_a, i, elements, j, is_edges, swapped != turned)
            if not allowed[labels[rows[0]], labels[rows[3]]]:
                continue
            x, y = corners(before, rows), corners(after, rows)
            if are_kept_apart(x, y, is_edges, squared):
                continue
            apart = distance_if_near(x, y, is_edges, squared)
            if apart >= 0.0:
                found[count], distances[count] = other << 32 | one if swapped else one << 32 | other, apart
                count += 1
    first, second = np.empty(count, np.int64), np.empty(count, np.int64)
    for k in range(count):
        first[k], second[k] = found[k] >> 32, found[k] & 0xFFFFFFFF
    return first, second, distances[:count].copy()


@part
def _overlapping(four: int, group: Floats, boxes: Floats, met: Ints, n_met: int, near: Ints) -> int:
    """Write the places in the leaves of boxes of the group and of fours met that overlap, i << 32 | j; how many."""
    count = 0
    for m in range(n_met):
        other = met[m]
        for k in range(FOUR):
            a, b, c, d, e, f = group[k, 0], group[k, 1], group[k, 2], group[k, 3], group[k, 4], group[k, 5]
            hits = that_overlap(boxes, other, a, b, c, d, e, f)
            pair = (FOUR * four + k) << 32 | FOUR * other
            for j in range(FOUR):  # all that is looked at is written, and counts if it overlaps: no branch to foresee
                near[count] = pair | j
                count += hits >> j & 1
    return count


@part
def _strangers(
    near: Ints, n: int, a: Ints, b: Ints, left_out: np.ndarray, itself: bool, turned: bool, is_edges: bool
) -> int:
    """Keep of the n pairs of places those that share no vertex, and with no j that is left out; how many they are."""
    count = 0
    for k in range(n):
        pair = near[k]
        i, j = pair >> 32, pair & 0xFFFFFFFF
        drop = left_out[j] & ((not itself) | (j <= i))
        near[count] = pair
        count += not (drop | share_a_vertex(_rows(a, i, b, j, is_edges, turned), is_edges))
    return count


@part
def _rows(a: Ints, i: int, b: Ints, j: int, is_edges: bool, turned: bool) -> tuple[int, int, int, int]:
    """The rows of x of the elements i of a and j of b, those of b first if turned."""
    return rows_of(b, j, a, i, is_edges) if turned else rows_of(a, i, b, j, is_edges)


@part
def _longer(found: np.ndarray, used: int, size: int) -> np.ndarray:
    """A copy of the used part in a longer array."""
    longer = np.empty(size, found.dtype)
    for k in range(used):  # number by number: assigning a slice takes 1.5 s more to compile, for its error message
        longer[k] = found[k]
    return longer
