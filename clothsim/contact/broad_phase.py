"""Which boxes of two trees overlap, or come near.

Overlap is closed: boxes that touch overlap. Which pairs are found depends on the boxes alone, their order on the trees.
Four boxes walk through the other tree as one, to the fours that they meet; there box is compared with box.
"""

import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.compiled import kernel, part
from clothsim.contact.box_tree import FOUR, BoxTree

Overlaps = tuple[Ints, Ints]
"""The first and the second of each pair, (p,) and (p,)."""

_DEPTH = 128
"""Deepest stack of a walk, 3 a level: more than the 2^31 boxes that 31 bits tell apart."""

_FEW = 32
"""Numbers that insertion sorts fastest."""


def overlapping(
    queries: BoxTree, tree: BoxTree, grown: float = 0.0, of: np.ndarray | None = None, but: np.ndarray | None = None
) -> Overlaps:
    """Boxes i of the one, grown by `grown` [m] on each side, and j of the other tree that overlap.

    of (N,): only those i that hang on one of these rows of x; but (N,): none of those j. `in_order` sorts the pairs.
    """
    if of is None and but is None and len(tree.order) < len(queries.order):  # what is asked, walks: let the fewer
        second, first = overlapping(tree, queries, grown)
        return first, second
    asked = np.ones(len(queries.order), bool) if of is None else queries.hanging(of)
    left_out = np.zeros(len(tree.order), bool) if but is None else tree.hanging(but)
    found = _met(queries.boxes, asked, tree.boxes, tree.starts, grown, False)
    return _told(found, queries.order, tree.order, left_out, False)


def overlapping_self(tree: BoxTree, grown: float = 0.0, of: np.ndarray | None = None) -> Overlaps:
    """Boxes i < j of the tree that overlap if one of them is grown by `grown` [m] on each side.

    of (N,): of each pair at least one hangs on one of these rows of x; all if None.
    """
    asked = np.ones(len(tree.order), bool) if of is None else tree.hanging(of)
    found = _met(tree.boxes, asked, tree.boxes, tree.starts, grown, of is None)
    return _told(found, tree.order, tree.order, asked, True)  # a pair of two that are asked is met twice


def in_order(overlaps: Overlaps) -> Ints:
    """The order (p,) of pairs by the first, then the second: what the tree was built from no longer shows in it."""
    first, second = overlaps
    n = int(first.max(initial=-1)) + 1
    if 8 * len(first) < n:
        return np.lexsort((second, first))
    return _order(first, second, n)


@part
def _meets(a: float, b: float, c: float, d: float, e: float, f: float, boxes: Floats, four: int, k: int) -> bool:
    """Whether the box with the corners (a, b, c) and (d, e, f) overlaps a box of a four."""
    return (
        (a <= boxes[four, 3, k])
        & (boxes[four, 0, k] <= d)
        & (b <= boxes[four, 4, k])
        & (boxes[four, 1, k] <= e)
        & (c <= boxes[four, 5, k])
        & (boxes[four, 2, k] <= f)
    )


@kernel
def _met(boxes_a: Floats, asked: np.ndarray, boxes: Floats, starts: Ints, grown: float, later: bool) -> Ints:
    """The places in the leaves of overlapping boxes of two trees, i << 32 | j.

    asked (m,): which i; later: of a tree with itself, all of which are asked, and only j from the four of i on.
    """
    found = np.empty(12 * asked.sum() + 64, np.int64)
    group, whole = np.empty((FOUR, 6)), np.empty(6)
    stack, met = np.empty(_DEPTH, np.int64), np.empty(starts[1] + FOUR, np.int64)
    count = 0
    for four in range((len(asked) + FOUR - 1) // FOUR):
        if not _gathered(four, boxes_a, asked, grown, group, whole):
            continue
        n_met = _fours_met(whole, four, boxes, starts, later, stack, met)
        most = FOUR * FOUR * n_met
        if count + most > len(found):
            found = _longer(found, count, 2 * (count + most))
        for k in range(FOUR):
            a, b, c, d, e, f = group[k, 0], group[k, 1], group[k, 2], group[k, 3], group[k, 4], group[k, 5]
            for m in range(n_met):  # all that is looked at is written, and counts if it meets: no branch to foresee
                for j in range(FOUR):
                    found[count] = (FOUR * four + k) << 32 | (FOUR * met[m] + j)
                    count += _meets(a, b, c, d, e, f, boxes, met[m], j)
    return found[:count]


@part
def _gathered(four: int, boxes: Floats, asked: np.ndarray, grown: float, group: Floats, whole: Floats) -> bool:
    """The boxes of a four that are asked for, grown, to `group`, and the one that holds them; whether there are any."""
    start, some = FOUR * four, False
    for place in range(start, min(start + FOUR, len(asked))):
        some |= asked[place]
    if not some:
        return False
    for side in range(6):
        whole[side] = np.inf if side < 3 else -np.inf
    for k in range(FOUR):
        mine = start + k < len(asked) and asked[start + k]
        for axis in range(3):
            low = boxes[four, axis, k] - grown if mine else np.nan
            high = boxes[four, 3 + axis, k] + grown if mine else np.nan
            group[k, axis], group[k, 3 + axis] = low, high
            whole[axis] = low if low < whole[axis] else whole[axis]
            whole[3 + axis] = high if high > whole[3 + axis] else whole[3 + axis]
    return True


@part
def _fours_met(box: Floats, four: int, boxes: Floats, starts: Ints, later: bool, stack: Ints, met: Ints) -> int:
    """Write the fours of elements that hold a box which meets `box` (6,) to `met`; how many it is.

    later: only from this four on: itself, and what comes after it on each level. The stack holds a four and, in its
    last eight bits, the level.
    """
    a, b, c, d, e, f = box[0], box[1], box[2], box[3], box[4], box[5]  # as numbers: what is written is no box
    top = n_met = 0
    if later or len(starts) == 2:
        met[0], n_met = (four if later else 0), 1
    else:
        stack[0], top = (starts[-1] - 1) << 8 | (len(starts) - 2), 1
    place, level = four, 1
    while top > 0 or (later and level < len(starts) - 1):
        above = 0
        if top > 0:
            top -= 1
            node, at = stack[top] >> 8, stack[top] & 255
        else:
            above, at = place + 1, level  # those after `place` in the four that holds it
            place, level = place // FOUR, level + 1
            node = starts[at] + place
        child = FOUR * (node - starts[at])
        for k in range(FOUR):
            hit = _meets(a, b, c, d, e, f, boxes, node, k) & (child + k >= above)
            if at == 1:
                met[n_met] = child + k
                n_met += hit
            else:
                stack[top] = (starts[at - 1] + child + k) << 8 | (at - 1)
                top += hit
    return n_met


@part
def _longer(found: Ints, used: int, size: int) -> Ints:
    """A copy of the used part in a longer array."""
    longer = np.empty(size, np.int64)
    for k in range(used):  # number by number: assigning a slice takes 1.5 s more to compile, for its error message
        longer[k] = found[k]
    return longer


@kernel
def _told(found: Ints, order_a: Ints, order: Ints, left_out: np.ndarray, itself: bool) -> tuple[Ints, Ints]:
    """The elements at the places found, the smaller first with `itself`; j is not left out unless it comes after i."""
    first, second = np.empty(len(found), np.int64), np.empty(len(found), np.int64)
    count = 0
    for k in range(len(found)):
        i, j = found[k] >> 32, found[k] & 0xFFFFFFFF
        one, other = order_a[i], order[j]
        swapped = itself & (other < one)
        first[count], second[count] = (other, one) if swapped else (one, other)
        count += (not left_out[j]) | (itself & (i < j))
    return first[:count].copy(), second[:count].copy()


@part
def _sort(values: Ints, start: int, end: int) -> None:
    """Sort values[start:end] in place: Shell's sort, which for up to _FEW numbers is insertion."""
    gap = 1
    while gap * _FEW < end - start:
        gap = 3 * gap + 1
    while gap > 0:
        for k in range(start + gap, end):
            value, place = values[k], k
            while place >= start + gap and values[place - gap] > value:
                values[place] = values[place - gap]
                place -= gap
            values[place] = value
        gap //= 3


@kernel
def _order(first: Ints, second: Ints, n: int) -> Ints:
    """The order of pairs by first, all below n, then second."""
    places = np.zeros(n + 1, np.int64)  # of the next pair of i; in the end of the first of i + 1
    for i in first:
        places[i + 1] += 1
    for i in range(n):
        places[i + 1] += places[i]
    order = np.empty(len(first), np.int64)
    for k in range(len(first)):
        order[places[first[k]]] = second[k] << 32 | k
        places[first[k]] += 1
    start = 0
    for i in range(n):
        _sort(order, start, places[i])
        start = places[i]
    for k in range(len(order)):
        order[k] &= 0xFFFFFFFF
    return order
