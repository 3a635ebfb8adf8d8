"""Which boxes overlap: a hierarchy of axis-aligned boxes, built for many boxes and refitted while they move a little.

The boxes are sorted along a Morton curve through their centres (Lauterbach et al. 2009, "Fast BVH construction on
GPUs") and cut in half again and again: a complete binary tree of which node k has the children 2k + 1 and 2k + 2. Its
shape depends on the number of boxes only, so nothing degenerates where boxes coincide, and a refit is one sweep.
Overlap is closed: boxes that touch overlap. Which pairs are found depends on the boxes alone, their order on the trees.
"""

from dataclasses import dataclass

import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.compiled import kernel, part

Overlaps = tuple[Ints, Ints]
"""The first and the second of each pair, (p,) and (p,)."""

LEAF = 4
"""Most boxes in a leaf."""

_MORTON_CELLS = 2.0**21
"""Cells of the Morton grid along the longest side: 3 x 21 bits fit one integer."""

_DEPTH = 64
"""Deepest stack of a walk: a tree of 2^62 leaves."""

_FEW = 32
"""Numbers that insertion sorts fastest."""


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


def overlapping(queries: BoxTree, tree: BoxTree) -> Overlaps:
    """Boxes i of the one and j of the other tree that overlap; `in_order` sorts them."""
    return _query(*_fields(queries), *_fields(tree), False)


def overlapping_self(tree: BoxTree) -> Overlaps:
    """Boxes i < j of the tree that overlap; `in_order` sorts them."""
    return _query(*_fields(tree), *_fields(tree), True)


def in_order(overlaps: Overlaps) -> Overlaps:
    """The same pairs sorted by the first, then the second: what the tree was built from no longer shows."""
    first, second = overlaps
    return _sorted_pairs(first, second, int(first.max(initial=-1)) + 1)


def _fields(tree: BoxTree) -> tuple[Ints, Ints, Floats, Floats]:
    return tree.order, tree.starts, tree.boxes, tree.nodes


def _fitted(order: Ints, starts: Ints, lower: Floats, upper: Floats) -> BoxTree:
    boxes = np.concatenate([lower[order], upper[order]], axis=1)
    return BoxTree(order, starts, boxes, _node_boxes(starts, boxes))


@kernel
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


@part
def _spread(bits: int) -> int:
    """The 21 lowest bits with two zeros between neighbours."""
    bits = (bits | bits << 32) & 0x1F00000000FFFF
    bits = (bits | bits << 16) & 0x1F0000FF0000FF
    bits = (bits | bits << 8) & 0x100F00F00F00F00F
    bits = (bits | bits << 4) & 0x10C30C30C30C30C3
    return (bits | bits << 2) & 0x1249249249249249


@kernel
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


@part
def _enclose(box: Floats, other: Floats) -> None:
    """Let `box` (6,) enclose `other` too."""
    for axis in range(3):
        box[axis] = min(box[axis], other[axis])
        box[3 + axis] = max(box[3 + axis], other[3 + axis])


@part
def _meet(a: Floats, i: int, b: Floats, j: int) -> bool:
    """Whether the boxes a[i] and b[j] overlap."""
    return (
        (a[i, 0] <= b[j, 3])
        & (b[j, 0] <= a[i, 3])
        & (a[i, 1] <= b[j, 4])
        & (b[j, 1] <= a[i, 4])
        & (a[i, 2] <= b[j, 5])
        & (b[j, 2] <= a[i, 5])
    )


@kernel
def _query(
    order_a: Ints,
    starts_a: Ints,
    boxes_a: Floats,
    nodes_a: Floats,
    order: Ints,
    starts: Ints,
    boxes: Floats,
    nodes: Floats,
    itself: bool,
) -> tuple[Ints, Ints]:
    """Overlapping boxes of two trees, or of one with `itself`: i < j then. Leaf by leaf: neighbours walk as one."""
    found, stack = np.empty((2, 4 * (len(order_a) + len(order)) + 16), np.int64), np.empty(_DEPTH, np.int64)
    leaves, count = len(starts_a) - 1, 0
    for leaf in range(leaves):
        top = _push(leaf, leaves, itself, stack)
        end = _walk(boxes_a, starts_a, nodes_a, leaf, itself, stack, top, starts, boxes, nodes, found, count)
        if end > found.shape[1]:  # once more, with room for all
            found, top = _longer(found, count, end), _push(leaf, leaves, itself, stack)
            _walk(boxes_a, starts_a, nodes_a, leaf, itself, stack, top, starts, boxes, nodes, found, count)
        count = end
    first, second = np.empty(count, np.int64), np.empty(count, np.int64)
    for k in range(count):
        i, j = order_a[found[0, k]], order[found[1, k]]
        first[k], second[k] = (j, i) if itself and j < i else (i, j)
    return first, second


@part
def _walk(
    boxes_a: Floats,
    starts_a: Ints,
    nodes_a: Floats,
    leaf_a: int,
    itself: bool,
    stack: Ints,
    top: int,
    starts: Ints,
    boxes: Floats,
    nodes: Floats,
    found: Ints,
    count: int,
) -> int:
    """Write the places of the boxes of a leaf and of those that meet them to found[:, count:]; how many it then needs.

    The walk starts at the `top` nodes on the stack. What does not fit into `found` is counted only: an array that
    grows in here would cost eight times as much.
    """
    last_inner = len(starts) - 3
    node_a = leaf_a + len(starts_a) - 2
    while top > 0:
        top -= 1
        node = stack[top]
        if not _meet(nodes_a, node_a, nodes, node):
            continue
        if node <= last_inner:
            stack[top], stack[top + 1], top = 2 * node + 2, 2 * node + 1, top + 2
            continue
        leaf = node - last_inner - 1
        for i in range(starts_a[leaf_a], starts_a[leaf_a + 1]):
            if not _meet(boxes_a, i, nodes, node):
                continue
            for j in range(max(starts[leaf], i + 1) if itself else starts[leaf], starts[leaf + 1]):
                if _meet(boxes_a, i, boxes, j):
                    if count < found.shape[1]:
                        found[0, count], found[1, count] = i, j
                    count += 1
    return count


@part
def _push(leaf: int, leaves: int, itself: bool, stack: Ints) -> int:
    """Put the root on the stack or, for a tree with itself, what comes from the leaf on. How many nodes that is."""
    if itself:
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
