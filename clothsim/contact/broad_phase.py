"""Which boxes overlap: a hierarchy of axis-aligned boxes, built for many boxes and refitted while they move a little.

The boxes are sorted along a Morton curve through their centres (Lauterbach et al. 2009, "Fast BVH construction on
GPUs") and cut in half again and again: a complete binary tree of which node k has the children 2k + 1 and 2k + 2. Its
shape depends on the number of boxes only, so nothing degenerates where boxes coincide, and a refit is one sweep.
Overlap is closed: boxes that touch overlap. Every answer is sorted and depends on the input alone.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

from clothsim.arrays import Floats, Ints

LEAF = 4
"""Most boxes in a leaf."""

_MORTON_CELLS = 2.0**21
"""Cells of the Morton grid along the longest side: 3 x 21 bits fit one integer."""

_DEPTH = 64
"""Deepest stack of a walk: a tree of 2^62 leaves."""

_FEW = 32
"""Numbers that insertion sorts faster than quicksort."""


@dataclass(frozen=True)
class BoxTree:
    """A complete binary tree over m boxes.

    order (m,): the boxes as the leaves hold them; starts (l + 1,): leaf i holds order[starts[i]:starts[i + 1]], l a
    power of two; boxes (m, 6): lower and upper corners in that order [m]; nodes (2 l - 1, 6): the boxes of the nodes,
    the root first, the leaves last [m]. An empty leaf has the box [inf, -inf], which overlaps nothing.
    """

    order: Ints
    starts: Ints
    boxes: Floats
    nodes: Floats


def build_tree(lower: Floats, upper: Floats) -> BoxTree:
    """A tree over the boxes lower (m, 3) <= upper (m, 3) [m], all finite; m may be 0."""
    order = np.argsort(_morton_codes(lower, upper), kind="stable")
    leaves = 1
    while leaves * LEAF < len(order):
        leaves *= 2
    starts = np.arange(leaves + 1) * len(order) // leaves
    return _fitted(order, starts, lower, upper)


def refit(tree: BoxTree, lower: Floats, upper: Floats) -> BoxTree:
    """The same tree with its boxes moved to lower, upper (m, 3) [m]: right for any boxes, fast if they moved little."""
    return _fitted(tree.order, tree.starts, lower, upper)


def overlapping(tree: BoxTree, lower: Floats, upper: Floats) -> Ints:
    """Pairs (p, 2) of a query i, a box lower (n, 3) to upper (n, 3) [m], and a box j of the tree that overlap.

    Sorted by i, then j.
    """
    first, second = _query(np.concatenate([lower, upper], axis=1), tree.order, tree.starts, tree.boxes, tree.nodes)
    return _sorted_pairs(first, second, len(lower))


def overlapping_self(tree: BoxTree) -> Ints:
    """Pairs (p, 2) of boxes i < j of the tree that overlap, sorted by i, then j."""
    first, second = _query_self(tree.order, tree.starts, tree.boxes, tree.nodes)
    return _sorted_pairs(first, second, len(tree.order))


def _fitted(order: Ints, starts: Ints, lower: Floats, upper: Floats) -> BoxTree:
    boxes = np.concatenate([lower[order], upper[order]], axis=1)
    return BoxTree(order, starts, boxes, _node_boxes(starts, boxes))


@njit(cache=True, error_model="numpy")
def _morton_codes(lower: Floats, upper: Floats) -> Ints:
    """Places of the boxes' centres along the Morton curve (m,)."""
    m = len(lower)
    codes = np.zeros(m, np.int64)
    least, extent = np.zeros(3), 0.0
    for axis in range(3):
        low, high = np.inf, -np.inf
        for i in range(m):
            centre = 0.5 * lower[i, axis] + 0.5 * upper[i, axis]
            low, high = min(low, centre), max(high, centre)
        least[axis], extent = low, max(extent, high - low)
    if not extent > 0.0:
        return codes
    for i in range(m):
        for axis in range(3):
            share = (0.5 * lower[i, axis] + 0.5 * upper[i, axis] - least[axis]) / extent
            cell = np.int64(min(share * _MORTON_CELLS, _MORTON_CELLS - 1.0))
            codes[i] |= _spread(cell) << axis
    return codes


@njit(cache=True, error_model="numpy")
def _spread(bits: int) -> int:
    """The 21 lowest bits with two zeros between neighbours."""
    bits = (bits | bits << 32) & 0x1F00000000FFFF
    bits = (bits | bits << 16) & 0x1F0000FF0000FF
    bits = (bits | bits << 8) & 0x100F00F00F00F00F
    bits = (bits | bits << 4) & 0x10C30C30C30C30C3
    return (bits | bits << 2) & 0x1249249249249249


@njit(cache=True, error_model="numpy")
def _node_boxes(starts: Ints, boxes: Floats) -> Floats:
    """The nodes' boxes (2 l - 1, 6), the leaves first, then upwards."""
    leaves = len(starts) - 1
    nodes = np.empty((2 * leaves - 1, 6))
    for node in range(2 * leaves - 2, -1, -1):
        nodes[node, :3], nodes[node, 3:] = np.inf, -np.inf
        leaf = node - (leaves - 1)
        if leaf >= 0:
            for i in range(starts[leaf], starts[leaf + 1]):
                _enclose(nodes[node], boxes[i])
        else:
            _enclose(nodes[node], nodes[2 * node + 1])
            _enclose(nodes[node], nodes[2 * node + 2])
    return nodes


@njit(cache=True, error_model="numpy")
def _enclose(box: Floats, other: Floats) -> None:
    """Let `box` (6,) enclose `other` too."""
    for axis in range(3):
        box[axis] = min(box[axis], other[axis])
        box[3 + axis] = max(box[3 + axis], other[3 + axis])


@njit(cache=True, error_model="numpy")
def _meet(a: Floats, i: int, b: Floats, j: int) -> bool:
    """Whether the boxes a[i] and b[j] overlap."""
    return (
        a[i, 0] <= b[j, 3]
        and b[j, 0] <= a[i, 3]
        and a[i, 1] <= b[j, 4]
        and b[j, 1] <= a[i, 4]
        and a[i, 2] <= b[j, 5]
        and b[j, 2] <= a[i, 5]
    )


@njit(cache=True, error_model="numpy")
def _query(queries: Floats, order: Ints, starts: Ints, boxes: Floats, nodes: Floats) -> tuple[Ints, Ints]:
    """Overlapping queries and boxes, by query."""
    found, stack = np.empty(2 * len(queries) + 16, np.int64), np.empty(_DEPTH, np.int64)
    ends = np.zeros(len(queries) + 1, np.int64)
    for query in range(len(queries)):
        stack[0] = 0
        end = _walk(queries, query, 0, stack, 1, order, starts, boxes, nodes, found, ends[query])
        if end > len(found):  # once more, with room for all
            found, stack[0] = _longer(found, ends[query], end), 0
            _walk(queries, query, 0, stack, 1, order, starts, boxes, nodes, found, ends[query])
        ends[query + 1] = end
    return np.repeat(np.arange(len(queries)), np.diff(ends)), found[: ends[-1]]


@njit(cache=True, error_model="numpy")
def _query_self(order: Ints, starts: Ints, boxes: Floats, nodes: Floats) -> tuple[Ints, Ints]:
    """Overlapping boxes i < j of the tree: each box against those after it in the leaves."""
    found, stack = np.empty(2 * len(order) + 16, np.int64), np.empty(_DEPTH, np.int64)
    ends = np.zeros(len(order) + 1, np.int64)
    for leaf in range(len(starts) - 1):
        for query in range(starts[leaf], starts[leaf + 1]):
            top = _push_later(leaf, len(starts) - 1, stack)
            end = _walk(boxes, query, query + 1, stack, top, order, starts, boxes, nodes, found, ends[query])
            if end > len(found):
                found, top = _longer(found, ends[query], end), _push_later(leaf, len(starts) - 1, stack)
                _walk(boxes, query, query + 1, stack, top, order, starts, boxes, nodes, found, ends[query])
            ends[query + 1] = end
    own = np.repeat(order, np.diff(ends))
    found = found[: ends[-1]]
    return np.minimum(own, found), np.maximum(own, found)


@njit(cache=True, error_model="numpy")
def _walk(
    queries: Floats,
    query: int,
    after: int,
    stack: Ints,
    top: int,
    order: Ints,
    starts: Ints,
    boxes: Floats,
    nodes: Floats,
    found: Ints,
    count: int,
) -> int:
    """Write the boxes that meet queries[query], from place `after` on, to found[count:]; how many it then needs.

    The walk starts at the `top` nodes on the stack. What does not fit into `found` is counted only: an array that
    grows in here would cost eight times as much.
    """
    last_inner = len(starts) - 3
    while top > 0:
        top -= 1
        node = stack[top]
        if not _meet(queries, query, nodes, node):
            continue
        if node <= last_inner:
            stack[top], stack[top + 1], top = 2 * node + 2, 2 * node + 1, top + 2
            continue
        leaf = node - last_inner - 1
        for i in range(max(starts[leaf], after), starts[leaf + 1]):
            if _meet(queries, query, boxes, i):
                if count < len(found):
                    found[count] = order[i]
                count += 1
    return count


@njit(cache=True, error_model="numpy")
def _push_later(leaf: int, leaves: int, stack: Ints) -> int:
    """Put a leaf and the subtrees right of its way to the root on the stack: all boxes from it on. Their number."""
    node, top = leaf + leaves - 1, 1
    stack[0] = node
    while node > 0:
        if node % 2 == 1:
            stack[top], top = node + 1, top + 1
        node = (node - 1) // 2
    return top


@njit(cache=True, error_model="numpy")
def _longer(values: Ints, used: int, needed: int) -> Ints:
    """A copy of the used part in an array of at least twice what is needed."""
    longer = np.empty(2 * needed, np.int64)
    longer[:used] = values[:used]
    return longer


@njit(cache=True, error_model="numpy")
def _sort(values: Ints, start: int, end: int) -> None:
    """Sort values[start:end] in place: by insertion where there are few, ten times faster than the call."""
    if end - start > _FEW:
        values[start:end].sort()
        return
    for k in range(start + 1, end):
        value, place = values[k], k
        while place > start and values[place - 1] > value:
            values[place] = values[place - 1]
            place -= 1
        values[place] = value


@njit(cache=True, error_model="numpy")
def _sorted_pairs(first: Ints, second: Ints, n: int) -> Ints:
    """Pairs (p, 2) sorted by first, all below n, then second."""
    ends = np.zeros(n + 1, np.int64)
    for i in first:
        ends[i + 1] += 1
    ends = np.cumsum(ends)
    places, seconds = ends[:-1].copy(), np.empty(len(first), np.int64)
    for k in range(len(first)):
        seconds[places[first[k]]] = second[k]
        places[first[k]] += 1
    pairs = np.empty((len(first), 2), np.int64)
    for i in range(n):
        _sort(seconds, ends[i], ends[i + 1])
        pairs[ends[i] : ends[i + 1], 0] = i
    pairs[:, 1] = seconds
    return pairs
