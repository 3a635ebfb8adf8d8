"""A hierarchy of axis-aligned boxes: built once for many elements, and set anew for those of them that move.

The boxes are sorted along a Hilbert curve through their centres and packed four by four, the boxes round each four
likewise, up to a last four (Kamel & Faloutsos 1993, "On packing R-trees"; along a Morton curve, which jumps, two fifths
more boxes of fours meet). The shape depends on the number of boxes only, so nothing degenerates where boxes coincide,
and a refit is one sweep. Four boxes lie side by side, corner by corner: one vector instruction compares with all four.
"""

from dataclasses import dataclass

import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.contact.closest_points import Point
from clothsim.jit import kernel, part

FOUR = 4
"""Boxes side by side."""

_CELLS = 2**21
"""Cells along the longest side, for the curve: 3 x 21 bits fit one integer."""


@dataclass(frozen=True)
class BoxTree:
    """A packed tree over the boxes of m elements, each of which encloses its element on a straight way.

    order (m,): the elements as the leaves hold them; elements (m, k): their rows of x in that order; boxes (g, 6, 4):
    lower and upper corners [m] of four boxes each, first those of the elements, then level by level those that enclose
    a four of the level below; starts (levels + 1,): where each level starts, the last of which is one four; hangs
    (N + 1,), places (m k,): places[hangs[i]:hangs[i + 1]] are the leaves' places of what hangs on row i of x. Where a
    four has no box there is NaN, which overlaps nothing.
    """

    order: Ints
    elements: Ints
    boxes: Floats
    starts: Ints
    hangs: Ints
    places: Ints

    def hanging(self, rows: np.ndarray) -> np.ndarray:
        """Which elements, by their places in the leaves (m,), hang on one of these rows of x (N,)."""
        return _hanging(self.hangs, self.places, rows, len(self.order))


def build_tree(elements: Ints, before: Floats, after: Floats) -> BoxTree:
    """A tree over elements (m, k), rows of before and after (N, 3) [m], where their ways begin and end; m may be 0."""
    order = np.argsort(_hilbert_codes(elements, before, after), kind="stable")
    sizes = [max(1, -(-len(order) // FOUR))]
    while sizes[-1] > 1:
        sizes.append(-(-sizes[-1] // FOUR))
    rows = elements[order].ravel()
    tree = BoxTree(
        order,
        elements[order],
        np.full((sum(sizes), 6, FOUR), np.nan),
        np.concatenate([[0], np.cumsum(sizes)]),
        np.concatenate([[0], np.cumsum(np.bincount(rows, minlength=len(before)))]),
        np.argsort(rows, kind="stable") // elements.shape[1],
    )
    refit(tree, before, after, np.ones(len(before), bool))
    return tree


def refit(tree: BoxTree, before: Floats, after: Floats, moved: np.ndarray) -> None:
    """Set the boxes in the tree anew of all elements with a row that has `moved` (N,): right for any boxes."""
    stale = tree.hanging(moved)
    if stale.any():
        _refit(tree.elements, stale, tree.boxes, tree.starts, before, after)


@kernel
def _hanging(hangs: Ints, places: Ints, rows: np.ndarray, m: int) -> np.ndarray:
    hanging = np.zeros(m, np.bool_)
    for i in range(len(rows)):
        if rows[i]:
            for k in range(hangs[i], hangs[i + 1]):
                hanging[places[k]] = True
    return hanging


@kernel
def _refit(elements: Ints, stale: np.ndarray, boxes: Floats, starts: Ints, before: Floats, after: Floats) -> None:
    """The boxes of the stale elements (m,), then upwards what lies round these."""
    fresh = np.zeros(len(boxes), np.bool_)
    for e in range(len(elements)):
        if stale[e]:
            four, k = e // FOUR, e % FOUR
            fresh[four] = True
            (
                (boxes[four, 0, k], boxes[four, 1, k], boxes[four, 2, k]),
                (boxes[four, 3, k], boxes[four, 4, k], boxes[four, 5, k]),
            ) = _box(elements, e, before, after)
    for level in range(len(starts) - 2):
        for four in range(starts[level], starts[level + 1]):
            if fresh[four]:
                place = four - starts[level]
                above = starts[level + 1] + place // FOUR
                _enclose(boxes, four, above, place % FOUR)
                fresh[above] = True


@part
def _box(elements: Ints, e: int, before: Floats, after: Floats) -> tuple[Point, Point]:
    """The corners of the box round an element on the way before -> after."""
    a = b = c = np.inf
    d = f = g = -np.inf
    for k in range(elements.shape[1]):
        i = elements[e, k]
        a, d = min(a, before[i, 0], after[i, 0]), max(d, before[i, 0], after[i, 0])
        b, f = min(b, before[i, 1], after[i, 1]), max(f, before[i, 1], after[i, 1])
        c, g = min(c, before[i, 2], after[i, 2]), max(g, before[i, 2], after[i, 2])
    return (a, b, c), (d, f, g)


@part
def _enclose(boxes: Floats, four: int, above: int, place: int) -> None:
    """Let the box at a place of the four `above` enclose a four: what is no number is passed over."""
    for axis in range(3):
        low, high = np.inf, -np.inf
        for k in range(FOUR):
            low = boxes[four, axis, k] if boxes[four, axis, k] < low else low
            high = boxes[four, 3 + axis, k] if boxes[four, 3 + axis, k] > high else high
        boxes[above, axis, place], boxes[above, 3 + axis, place] = low, high


@kernel
def _hilbert_codes(elements: Ints, before: Floats, after: Floats) -> Ints:
    """Places of the boxes' centres along the Hilbert curve (m,)."""
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
            share = (centres[e, axis] - least[axis]) / extent
            cell[axis] = np.int64(min(share * _CELLS, _CELLS - 1.0)) if share >= 0.0 else 0
        codes[e] = _along_the_curve(cell)
    return codes


@part
def _along_the_curve(cell: Ints) -> int:
    """The place of a cell (3,) along the curve; overwrites it (Skilling 2004, "Programming the Hilbert curve")."""
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
    return _spread(cell[0] ^ flips) << 2 | _spread(cell[1] ^ flips) << 1 | _spread(cell[2] ^ flips)


@part
def _spread(bits: int) -> int:
    """The 21 lowest bits with two zeros between neighbours."""
    bits = (bits | bits << 32) & 0x1F00000000FFFF
    bits = (bits | bits << 16) & 0x1F0000FF0000FF
    bits = (bits | bits << 8) & 0x100F00F00F00F00F
    bits = (bits | bits << 4) & 0x10C30C30C30C30C3
    return (bits | bits << 2) & 0x1249249249249249
