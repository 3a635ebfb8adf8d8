"""4-wide bounding volume hierarchy of axis-aligned boxes: built once, refitted where elements have moved, traversed.

The boxes are sorted along a Hilbert curve through their centres and packed four by four, the boxes enclosing each four
likewise, up to a last four (Kamel & Faloutsos 1993, "On packing R-trees"; along a Morton curve, which jumps, two fifths
more node boxes overlap). The shape depends on the number of boxes only, so coincident boxes degenerate nothing, and a
refit is one sweep. A node stores its four boxes side by side, bound by bound: one vector instruction compares with all
four.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from clothsim.base.arrays import Floats, Ints
from clothsim.base.jit import kernel, part
from clothsim.physics.contact.distance import Point

WIDTH = 4
"""Boxes of a node."""

_CELLS = 2**21
"""Cells along the longest side for the curve: 3 x 21 bits fit one integer."""


@dataclass(frozen=True)
class BoxTree:
    """Packed tree over the boxes of m elements, each of which encloses its element on a linear path.

    Attributes
    ----------
    order : (m,) int array
        The elements in the order of the leaves.
    elements : (m, k) int array
        Their rows of x in that order.
    boxes : (g, 6, 4) array
        Nodes: lower and upper corners [m] of four boxes each, first those of the elements, then level by level those
        that enclose a node of the level below. NaN where a node has no box, which overlaps nothing.
    starts : (levels + 1,) int array
        First node of each level, the last of which is one node.
    incident_starts, incident_leaves : (N + 1,), (m k,) int array
        incident_leaves[incident_starts[i]:incident_starts[i + 1]] are the leaves of the elements incident to row i of
        x.
    """

    order: Ints
    elements: Ints
    boxes: Floats
    starts: Ints
    incident_starts: Ints
    incident_leaves: Ints

    def incident(self, rows: np.ndarray) -> np.ndarray:
        """Mask (m,) over the leaves: elements incident to one of these rows of x (N,)."""
        return _incident(self.incident_starts, self.incident_leaves, rows, len(self.order))


def build_tree(elements: Ints, before: Floats, after: Floats) -> BoxTree:
    """Tree over elements (m, k), rows of `before` and `after` (N, 3) [m], the ends of their paths; m may be 0."""
    order = hilbert_order(elements, before, after)
    sizes = [max(1, -(-len(order) // WIDTH))]
    while sizes[-1] > 1:
        sizes.append(-(-sizes[-1] // WIDTH))
    rows = elements[order].ravel()
    tree = BoxTree(
        order,
        elements[order],
        np.full((sum(sizes), 6, WIDTH), np.nan),
        np.concatenate([[0], np.cumsum(sizes)]),
        np.concatenate([[0], np.cumsum(np.bincount(rows, minlength=len(before)))]),
        np.argsort(rows, kind="stable") // elements.shape[1],
    )
    refit(tree, before, after, np.ones(len(before), bool))
    return tree


def hilbert_order(elements: Ints, before: Floats, after: Floats) -> Ints:
    """Elements (m, k) in the order of their boxes along the curve, (m,)."""
    return np.argsort(_hilbert_codes(elements, before, after), kind="stable")


def refit(tree: BoxTree, before: Floats, after: Floats, moved: np.ndarray) -> None:
    """Update the boxes of all elements with a row that has `moved` (N,), and those that enclose them."""
    stale = tree.incident(moved)
    if stale.any():
        _refit(tree.elements, stale, tree.boxes, tree.starts, before, after)


@kernel
def _incident(incident_starts: Ints, incident_leaves: Ints, rows: np.ndarray, m: int) -> np.ndarray:
    """Compiled part of `BoxTree.incident`."""
    incident = np.zeros(m, np.bool_)
    for i in range(len(rows)):
        if rows[i]:
            for k in range(incident_starts[i], incident_starts[i + 1]):
                incident[incident_leaves[k]] = True
    return incident


@kernel
def _refit(elements: Ints, stale: np.ndarray, boxes: Floats, starts: Ints, before: Floats, after: Floats) -> None:
    """Update the boxes of the stale elements (m,), then upwards the boxes that enclose them."""
    updated = np.zeros(len(boxes), np.bool_)
    for e in range(len(elements)):
        if stale[e]:
            node, k = e // WIDTH, e % WIDTH
            updated[node] = True
            (
                (boxes[node, 0, k], boxes[node, 1, k], boxes[node, 2, k]),
                (boxes[node, 3, k], boxes[node, 4, k], boxes[node, 5, k]),
            ) = _box(elements, e, before, after)
    for level in range(len(starts) - 2):
        for node in range(starts[level], starts[level + 1]):
            if updated[node]:
                index = node - starts[level]
                parent = starts[level + 1] + index // WIDTH
                _enclose(boxes, node, parent, index % WIDTH)
                updated[parent] = True


@part
def _box(elements: Ints, e: int, before: Floats, after: Floats) -> tuple[Point, Point]:
    """Corners of the box around an element on the path before -> after."""
    a = b = c = np.inf
    d = f = g = -np.inf
    for k in range(elements.shape[1]):
        i = elements[e, k]
        a, d = min(a, before[i, 0], after[i, 0]), max(d, before[i, 0], after[i, 0])
        b, f = min(b, before[i, 1], after[i, 1]), max(f, before[i, 1], after[i, 1])
        c, g = min(c, before[i, 2], after[i, 2]), max(g, before[i, 2], after[i, 2])
    return (a, b, c), (d, f, g)


@part
def _enclose(boxes: Floats, node: int, parent: int, index: int) -> None:
    """Let the box `index` of the node `parent` enclose a node; NaN is ignored."""
    for axis in range(3):
        low, high = np.inf, -np.inf
        for k in range(WIDTH):
            low = boxes[node, axis, k] if boxes[node, axis, k] < low else low
            high = boxes[node, 3 + axis, k] if boxes[node, 3 + axis, k] > high else high
        boxes[parent, axis, index], boxes[parent, 3 + axis, index] = low, high


@kernel
def _hilbert_codes(elements: Ints, before: Floats, after: Floats) -> Ints:
    """Positions of the boxes' centres along the Hilbert curve (m,)."""
    m = len(elements)
    codes, centres, cell = np.zeros(m, np.int64), np.empty((m, 3)), np.empty(3, np.int64)
    for e in range(m):
        low, high = _box(elements, e, before, after)
        for axis in range(3):
            centres[e, axis] = 0.5 * low[axis] + 0.5 * high[axis]
    least, extent = np.zeros(3), 0.0
    for axis in range(3):
        first, last = np.inf, -np.inf
        for e in range(m):
            first, last = min(first, centres[e, axis]), max(last, centres[e, axis])
        least[axis], extent = first, max(extent, last - first)
    if not (extent > 0.0 and extent < np.inf):
        return codes
    for e in range(m):
        for axis in range(3):
            fraction = (centres[e, axis] - least[axis]) / extent
            cell[axis] = np.int64(min(fraction * _CELLS, _CELLS - 1.0)) if fraction >= 0.0 else 0
        codes[e] = _hilbert_index(cell)
    return codes


@part
def _hilbert_index(cell: Ints) -> int:
    """Position of a cell (3,) along the curve; overwrites it (Skilling 2004, "Programming the Hilbert curve")."""
    bit, flips = _CELLS // 2, 0
    while bit > 1:
        for axis in range(3):
            if cell[axis] & bit:
                cell[0] ^= bit - 1
            else:
                other = (cell[0] ^ cell[axis]) & (bit - 1)
                cell[0] ^= other
                cell[axis] ^= other
        bit //= 2
    cell[1] ^= cell[0]
    cell[2] ^= cell[1]
    bit = _CELLS // 2
    while bit > 1:
        flips ^= (bit - 1) if cell[2] & bit else 0
        bit //= 2
    return _spaced_bits(cell[0] ^ flips) << 2 | _spaced_bits(cell[1] ^ flips) << 1 | _spaced_bits(cell[2] ^ flips)


@part
def _spaced_bits(bits: int) -> int:
    """The 21 lowest bits with two zeros between neighbours."""
    bits = (bits | bits << 32) & 0x1F00000000FFFF
    bits = (bits | bits << 16) & 0x1F0000FF0000FF
    bits = (bits | bits << 8) & 0x100F00F00F00F00F
    bits = (bits | bits << 4) & 0x10C30C30C30C30C3
    return (bits | bits << 2) & 0x1249249249249249


# Overlap test, written as vector instructions: LLVM's own vectoriser leaves the comparisons scalar.


_FLOATS = ir.VectorType(ir.DoubleType(), WIDTH)
_SAME = ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), [0] * WIDTH)


@intrinsic
def overlap_mask(context: Any, boxes: Any, node: Any, a: Any, b: Any, c: Any, d: Any, e: Any, f: Any) -> Any:
    """Bit mask of the boxes of a node in `boxes` (g, 6, 4) that overlap the box (a, b, c), (d, e, f).

    Bit k is for box k. Overlap is closed; NaN overlaps nothing. node: its index, not negative.
    """

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        array = context.make_array(signature.args[0])(context, builder, args[0])
        start = builder.mul(args[1], ir.Constant(ir.IntType(64), 6 * WIDTH))
        overlap = ir.Constant(ir.VectorType(ir.IntType(1), WIDTH), [1] * WIDTH)
        for side in range(6):
            address = builder.add(start, ir.Constant(ir.IntType(64), side * WIDTH))
            stored = builder.load(builder.bitcast(builder.gep(array.data, [address]), _FLOATS.as_pointer()), align=8)
            opposite = args[2 + (side + 3) % 6]
            nothing = ir.Constant(_FLOATS, ir.Undefined)
            one = builder.insert_element(nothing, opposite, ir.Constant(ir.IntType(32), 0))
            query = builder.shuffle_vector(one, nothing, _SAME)
            low, high = (stored, query) if side < 3 else (query, stored)
            overlap = builder.and_(overlap, builder.fcmp_ordered("<=", low, high))
        return builder.zext(builder.bitcast(overlap, ir.IntType(WIDTH)), ir.IntType(64))

    return types.int64(boxes, types.int64, *6 * [types.float64]), generate


# Traversal: the four boxes of a node query the tree at a time.

STACK_SIZE = 128
"""Capacity of the traversal stack, 3 a level: more than for the 2^31 boxes that 31 bits distinguish."""


@part
def gather_queries(
    query_node: int, boxes: Floats, queried: np.ndarray, inflation: float, queries: Floats, bounds: Floats
) -> bool:
    """Copy the queried boxes of a node, inflated, to `queries`, their enclosing box to `bounds`; False if none."""
    start, any_queried = WIDTH * query_node, False
    for index in range(start, min(start + WIDTH, len(queried))):
        any_queried |= queried[index]
    if not any_queried:
        return False
    for side in range(6):
        bounds[side] = np.inf if side < 3 else -np.inf
    for k in range(WIDTH):
        present = start + k < len(queried) and queried[start + k]
        for axis in range(3):
            low = boxes[query_node, axis, k] - inflation if present else np.nan
            high = boxes[query_node, 3 + axis, k] + inflation if present else np.nan
            queries[k, axis], queries[k, 3 + axis] = low, high
            bounds[axis] = low if low < bounds[axis] else bounds[axis]
            bounds[3 + axis] = high if high > bounds[3 + axis] else bounds[3 + axis]
    return True


@part
def overlapped_nodes(
    box: Floats, query_node: int, boxes: Floats, starts: Ints, after_query: bool, stack: Ints, hit_nodes: Ints
) -> int:
    """Write the leaf nodes that contain a box overlapping `box` (6,) to `hit_nodes`; returns their number.

    after_query: only the query's own node and those after it on each level. The stack holds a node and, in its last
    eight bits, the level.
    """
    # as scalars: the compiler then knows that the arrays written to do not alias the box
    a, b, c, d, e, f = box[0], box[1], box[2], box[3], box[4], box[5]
    top = n_hits = 0
    if after_query or len(starts) == 2:
        hit_nodes[0], n_hits = (query_node if after_query else 0), 1
    else:
        stack[0], top = (starts[-1] - 1) << 8 | (len(starts) - 2), 1
    index, level = query_node, 1
    while top > 0 or (after_query and level < len(starts) - 1):
        first_child = 0
        if top > 0:
            top -= 1
            node, node_level = stack[top] >> 8, stack[top] & 255
        else:
            first_child, node_level = index + 1, level  # those after `index` in their parent
            index, level = index // WIDTH, level + 1
            node = starts[node_level] + index
        child = WIDTH * (node - starts[node_level])
        mask = overlap_mask(boxes, node, a, b, c, d, e, f)
        if child < first_child:
            mask = mask >> (first_child - child) << (first_child - child)
        for k in range(WIDTH):  # branch-free: all four are written, only hits advance the counter
            hit = mask >> k & 1
            if node_level == 1:
                hit_nodes[n_hits] = child + k
                n_hits += hit
            else:
                stack[top] = (starts[node_level - 1] + child + k) << 8 | (node_level - 1)
                top += hit
    return n_hits
