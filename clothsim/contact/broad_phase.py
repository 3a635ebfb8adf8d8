"""Which boxes of two trees overlap, or come near.

Overlap is closed: boxes that touch overlap. Which pairs are found depends on the boxes alone, their order on the trees.
"""

import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.compiled import kernel, part
from clothsim.contact.box_tree import LEAF, BoxTree

Overlaps = tuple[Ints, Ints]
"""The first and the second of each pair, (p,) and (p,)."""

_DEPTH = 64
"""Deepest stack of a walk: a tree of 2^62 leaves."""

_FEW = 32
"""Numbers that insertion sorts fastest."""


def overlapping(
    queries: BoxTree, tree: BoxTree, grown: float = 0.0, of: np.ndarray | None = None, but: np.ndarray | None = None
) -> Overlaps:
    """Boxes i of the one, grown by `grown` [m] on each side, and j of the other tree that overlap.

    of: which i (m,) are asked for, all if None; but: which j are left out, none if None. `in_order` sorts the pairs.
    """
    if of is None and but is None and len(tree.order) < len(queries.order):  # what is asked, walks: let the fewer
        second, first = overlapping(tree, queries, grown)
        return first, second
    asked = np.ones(len(queries.order), bool) if of is None else of[queries.order]
    left_out = np.zeros(len(tree.order), bool) if but is None else but[tree.order]
    return _query(*_fields(queries), asked, *_fields(tree), left_out, grown, False, False)


def overlapping_self(tree: BoxTree, grown: float = 0.0, of: np.ndarray | None = None) -> Overlaps:
    """Boxes i < j of the tree that overlap if one of them is grown by `grown` [m] on each side.

    of: which (m,) are asked for, of each pair at least one; all if None.
    """
    asked = np.ones(len(tree.order), bool) if of is None else of[tree.order]
    return _query(*_fields(tree), asked, *_fields(tree), asked, grown, True, of is None)


def in_order(overlaps: Overlaps) -> Overlaps:
    """The same pairs sorted by the first, then the second: what the tree was built from no longer shows."""
    first, second = overlaps
    n = int(first.max(initial=-1)) + 1
    if 8 * len(first) < n:
        order = np.lexsort((second, first))
        return first[order], second[order]
    return _sorted_pairs(first, second, n)


def _fields(tree: BoxTree) -> tuple[Ints, Ints, Floats, Floats]:
    return tree.order, tree.starts, tree.boxes, tree.nodes


@part
def _meet(a: float, b: float, c: float, d: float, e: float, f: float, boxes: Floats, i: int) -> bool:
    """Whether the box with the corners (a, b, c) and (d, e, f) overlaps boxes[i]."""
    return (
        (a <= boxes[i, 3])
        & (boxes[i, 0] <= d)
        & (b <= boxes[i, 4])
        & (boxes[i, 1] <= e)
        & (c <= boxes[i, 5])
        & (boxes[i, 2] <= f)
    )


@kernel
def _query(
    order_a: Ints,
    starts_a: Ints,
    boxes_a: Floats,
    nodes_a: Floats,
    asked: np.ndarray,
    order: Ints,
    starts: Ints,
    boxes: Floats,
    nodes: Floats,
    left_out: np.ndarray,
    grown: float,
    itself: bool,
    every: bool,
) -> tuple[Ints, Ints]:
    """Overlapping boxes of two trees, or of one with `itself`: i < j then. Leaf by leaf: neighbours walk as one.

    asked, left_out: by their places in the leaves; with `itself`, left_out is asked: a pair of two is found once.
    every: all of the tree itself are asked.
    """
    found = np.empty((2, 4 * (len(order_a) + len(order)) + 16), np.int64)
    group, places = np.empty((LEAF + 1, 6)), np.empty(LEAF, np.int64)
    stack, met = np.empty(_DEPTH, np.int64), np.empty(len(starts), np.int64)
    leaves, count = len(starts_a) - 1, 0
    for leaf in range(leaves):
        size = _gathered(leaf, starts_a, boxes_a, asked, grown, group, places)
        if size == 0:
            continue
        top = _push(leaf, leaves, every, stack)
        n_met = _leaves_met(group[size], nodes, len(starts) - 1, stack, top, met)
        if count + size * LEAF * n_met > found.shape[1]:
            found = _longer(found, count, count + size * LEAF * n_met)
        for k in range(size):
            count = _boxes_met(group[k], places[k], met, n_met, starts, boxes, left_out, itself, found, count)
    first, second = np.empty(count, np.int64), np.empty(count, np.int64)
    for k in range(count):
        i, j = order_a[found[0, k]], order[found[1, k]]
        first[k], second[k] = (j, i) if itself and j < i else (i, j)
    return first, second


@part
def _gathered(
    leaf: int, starts: Ints, boxes: Floats, asked: np.ndarray, grown: float, group: Floats, places: Ints
) -> int:
    """The boxes of a leaf that are asked for, grown, to `group`, then the one that holds them all. Their number."""
    size = 0
    for i in range(starts[leaf], starts[leaf + 1]):
        if asked[i]:
            places[size] = i
            for axis in range(3):
                group[size, axis], group[size, 3 + axis] = boxes[i, axis] - grown, boxes[i, 3 + axis] + grown
            size += 1
    for axis in range(3):
        group[size, axis], group[size, 3 + axis] = np.inf, -np.inf
        for k in range(size):
            group[size, axis] = min(group[size, axis], group[k, axis])
            group[size, 3 + axis] = max(group[size, 3 + axis], group[k, 3 + axis])
    return size


@part
def _leaves_met(box: Floats, nodes: Floats, leaves: int, stack: Ints, top: int, met: Ints) -> int:
    """Write the leaves that meet a box (6,), of those below the `top` nodes on the stack, to `met`; how many it is."""
    a, b, c, d, e, f = box[0], box[1], box[2], box[3], box[4], box[5]  # as numbers: what is written is no box
    count = 0
    while top > 0:
        top -= 1
        node = stack[top]
        if not _meet(a, b, c, d, e, f, nodes, node):
            continue
        if node < leaves - 1:
            stack[top], stack[top + 1], top = 2 * node + 2, 2 * node + 1, top + 2
        else:
            met[count], count = node - (leaves - 1), count + 1
    return count


@part
def _boxes_met(
    box: Floats,
    place: int,
    met: Ints,
    n_met: int,
    starts: Ints,
    boxes: Floats,
    left_out: np.ndarray,
    itself: bool,
    found: Ints,
    count: int,
) -> int:
    """Write `place` and the places of the boxes in these leaves that meet a box (6,) to found; the count then.

    All that is looked at is written, and counts if it meets: a branch that nobody can foresee would take longer.
    """
    a, b, c, d, e, f = box[0], box[1], box[2], box[3], box[4], box[5]
    for k in range(n_met):
        for j in range(starts[met[k]], starts[met[k] + 1]):
            found[0, count], found[1, count] = place, j
            count += _meet(a, b, c, d, e, f, boxes, j) & ((not left_out[j]) | (itself & (place < j)))
    return count


@part
def _push(leaf: int, leaves: int, every: bool, stack: Ints) -> int:
    """Put the root on the stack or, for all of a tree with itself, what comes from the leaf on. How many nodes."""
    if every:
        return _push_later(leaf, leaves, stack)
    stack[0] = 0
    return 1


@part
def _push_later(leaf: int, leaves: int, stack: Ints) -> int:
    """Put a leaf and the subtrees right of its way to the root on the stack: all boxes from it on. Their number."""
    node, top = leaf + leaves - 1, 1
    stack[0] = node
    while node > 0:
        if node % 2 == 1:
            stack[top], top = node + 1, top + 1
        node = (node - 1) // 2
    return top


@part
def _longer(found: Ints, used: int, needed: int) -> Ints:
    """A copy of the used part in an array of at least twice what is needed."""
    longer = np.empty((2, 2 * needed), np.int64)
    for k in range(used):  # number by number: assigning a slice takes 1.5 s more to compile, for its error message
        longer[0, k], longer[1, k] = found[0, k], found[1, k]
    return longer


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
def _sorted_pairs(first: Ints, second: Ints, n: int) -> tuple[Ints, Ints]:
    """Pairs sorted by first, all below n, then second."""
    places = np.zeros(n + 1, np.int64)  # of the next pair of i; in the end of the first of i + 1
    for i in first:
        places[i + 1] += 1
    for i in range(n):
        places[i + 1] += places[i]
    firsts, seconds = np.empty(len(first), np.int64), np.empty(len(first), np.int64)
    for k in range(len(first)):
        place = places[first[k]]
        firsts[place], seconds[place] = first[k], second[k]
        places[first[k]] += 1
    start = 0
    for i in range(n):
        _sort(seconds, start, places[i])
        start = places[i]
    return firsts, seconds
