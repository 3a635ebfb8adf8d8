"""A hierarchy of axis-aligned boxes: built once for many elements, and set anew for those of them that move.

The boxes are sorted along a Morton curve through their centres (Lauterbach et al. 2009, "Fast BVH construction on
GPUs") and cut in half again and again: a complete binary tree of which node k has the children 2k + 1 and 2k + 2. Its
shape depends on the number of boxes only, so nothing degenerates where boxes coincide, and a refit is one sweep.
"""

from dataclasses import dataclass

import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.compiled import kernel, part

LEAF = 4
"""Most boxes in a leaf."""

_MORTON_CELLS = 2.0**21
"""Cells of the Morton grid along the longest side: 3 x 21 bits fit one integer."""


@dataclass(frozen=True)
class BoxTree:
    """A complete binary tree over the boxes of m elements, each of which encloses its element on a straight way.

    order (m,): the elements as the leaves hold them; elements (m, k): their rows of x in that order; starts (l + 1,):
    leaf i holds order[starts[i]:starts[i + 1]], l a power of two; boxes (m, 6): lower and upper corners in that order
    [m]; nodes (2 l - 1, 6): the boxes of the nodes, the root first, the leaves last [m]. An empty leaf has the box
    [inf, -inf], which overlaps nothing.
    """

    order: Ints
    elements: Ints
    starts: Ints
    boxes: Floats
    nodes: Floats


def build_tree(elements: Ints, before: Floats, after: Floats) -> BoxTree:
    """A tree over elements (m, k), rows of before and after (N, 3) [m], where their ways begin and end; m may be 0."""
    order = np.argsort(_morton_codes(elements, before, after), kind="stable")
    leaves = 1
    while leaves * LEAF < len(order):
        leaves *= 2
    starts = np.arange(leaves + 1) * len(order) // leaves
    tree = BoxTree(order, elements[order], starts, np.empty((len(order), 6)), np.empty((2 * leaves - 1, 6)))
    tree.nodes[:, :3], tree.nodes[:, 3:] = np.inf, -np.inf
    refit(tree, before, after, np.ones(len(before), bool))
    return tree


def refit(tree: BoxTree, before: Floats, after: Floats, moved: np.ndarray) -> None:
    """Set the boxes in the tree anew of all elements with a row that has `moved` (N,): right for any boxes."""
    _refit(tree.elements, tree.starts, tree.boxes, tree.nodes, before, after, moved)


@kernel
def _refit(
    elements: Ints, starts: Ints, boxes: Floats, nodes: Floats, before: Floats, after: Floats, moved: np.ndarray
) -> None:
    """The boxes, the leaves that hold them, then upwards what lies over these."""
    leaves = len(starts) - 1
    stale = np.zeros(len(nodes), np.bool_)
    for leaf in range(leaves):
        node = leaf + leaves - 1
        for i in range(starts[leaf], starts[leaf + 1]):
            has_moved = False
            for k in range(elements.shape[1]):
                has_moved |= moved[elements[i, k]]
            if has_moved:
                _set_box(boxes[i], elements, i, before, after)
                stale[node] = True
        if stale[node]:
            _empty(nodes[node])
            for i in range(starts[leaf], starts[leaf + 1]):
                _enclose(nodes[node], boxes[i])
    for node in range(2 * leaves - 2, -1, -1):
        if not stale[node]:
            continue
        if node < leaves - 1:
            _empty(nodes[node])
            _enclose(nodes[node], nodes[2 * node + 1])
            _enclose(nodes[node], nodes[2 * node + 2])
        if node > 0:
            stale[(node - 1) // 2] = True


@part
def _set_box(box: Floats, elements: Ints, e: int, before: Floats, after: Floats) -> None:
    """The box (6,) of an element on the way before -> after."""
    for axis in range(3):
        low, high = np.inf, -np.inf
        for k in range(elements.shape[1]):
            i = elements[e, k]
            low = min(low, before[i, axis], after[i, axis])
            high = max(high, before[i, axis], after[i, axis])
        box[axis], box[3 + axis] = low, high


@part
def _empty(box: Floats) -> None:
    for axis in range(3):
        box[axis], box[3 + axis] = np.inf, -np.inf


@part
def _enclose(box: Floats, other: Floats) -> None:
    """Let `box` (6,) enclose `other` too."""
    for axis in range(3):
        box[axis] = min(box[axis], other[axis])
        box[3 + axis] = max(box[3 + axis], other[3 + axis])


@kernel
def _morton_codes(elements: Ints, before: Floats, after: Floats) -> Ints:
    """Places of the boxes' centres along the Morton curve (m,)."""
    m = len(elements)
    codes, centres, box = np.zeros(m, np.int64), np.empty((m, 3)), np.empty(6)
    for e in range(m):
        _set_box(box, elements, e, before, after)
        for axis in range(3):
            centres[e, axis] = 0.5 * box[axis] + 0.5 * box[3 + axis]
    least, extent = np.zeros(3), 0.0
    for axis in range(3):
        low, high = np.inf, -np.inf
        for e in range(m):
            low, high = min(low, centres[e, axis]), max(high, centres[e, axis])
        least[axis], extent = low, max(extent, high - low)
    if not (extent > 0.0 and extent < np.inf):
        return codes
    for e in range(m):
        for axis in range(3):
            share = (centres[e, axis] - least[axis]) / extent
            cell = np.int64(min(share * _MORTON_CELLS, _MORTON_CELLS - 1.0)) if share >= 0.0 else 0
            codes[e] |= _spread(cell) << axis
    return codes


@part
def _spread(bits: int) -> int:
    """The 21 lowest bits with two zeros between neighbours."""
    bits = (bits | bits << 32) & 0x1F00000000FFFF
    bits = (bits | bits << 16) & 0x1F0000FF0000FF
    bits = (bits | bits << 8) & 0x100F00F00F00F00F
    bits = (bits | bits << 4) & 0x10C30C30C30C30C3
    return (bits | bits << 2) & 0x1249249249249249
