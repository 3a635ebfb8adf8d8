"""Self-crossing panels: borders with two sides that meet away from a common vertex."""

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.patterns.borders import Border, enclosed_area
from clothsim.patterns.pattern import Panel

BLOCK = 2**20
"""Pairs of sides that are held at once."""
THINNEST = 1e-6
"""Area of a panel below which it has none, as a fraction of its squared perimeter: a strip of 1 m by 4 micrometres."""


def refuse_self_crossing(panel: Panel, border: Border) -> None:
    """InputError for a border that crosses or touches itself, with the two edges and the place, or encloses no area."""
    crossing = crossing_sides(border.points)
    if not len(crossing):
        perimeter = np.linalg.norm(np.diff(border.points, axis=0, append=border.points[:1]), axis=1).sum()
        if abs(enclosed_area(border.points)) < THINNEST * perimeter**2:
            raise InputError(f"Panel {panel.name} has no area: its edges lie on one line.", "Move a vertex of it.")
        return
    first, second = crossing[0]
    edges = np.searchsorted(border.starts, [first, second], side="right") - 1
    x, y = border.points[first]
    where = f"edges {edges[0]} and {edges[1]} meet" if edges[0] != edges[1] else f"edge {edges[0]} meets itself"
    raise InputError(
        f"Panel {panel.name} crosses itself: {where} near ({x:.3g}, {y:.3g}) m.",
        "Move a vertex or a control point of one of them.",
    )


def crossing_sides(points: Floats) -> Ints:
    """Pairs (k, 2) of sides of a closed polygon that meet although they are no neighbours.

    Neighbours that fold back onto each other are found as well. A side runs from the point of its number to the next.
    Sides are swept along x, BLOCK pairs at a time; the first block with a crossing ends the search.
    """
    count = len(points)
    following = np.roll(points, -1, axis=0)
    low, high = np.minimum(points, following), np.maximum(points, following)
    order = np.argsort(low[:, 0], kind="stable")
    ends = np.searchsorted(low[order, 0], high[order, 0], side="right")  # sides that begin before this one ends
    partners = np.maximum(ends - np.arange(count) - 1, 0)
    total = np.concatenate([[0], np.cumsum(partners)])
    for begin in range(0, int(total[-1]), BLOCK):
        row = np.arange(begin, min(begin + BLOCK, int(total[-1])))
        own = np.searchsorted(total, row, side="right") - 1
        pairs = np.sort(np.column_stack([order[own], order[own + 1 + row - total[own]]]), axis=1)
        first, second = pairs.T
        beside = (low[first, 1] <= high[second, 1]) & (low[second, 1] <= high[first, 1])
        found = _crossing(points, following, pairs[beside])
        if len(found):
            return found[np.lexsort(found.T[::-1])]
    return np.zeros((0, 2), np.int64)


def _crossing(points: Floats, following: Floats, pairs: Ints) -> Ints:
    """Those of the pairs (k, 2) of sides that meet away from a common vertex, or fold onto each other."""
    count = len(points)
    first, second = pairs.T
    beside = (second - first == 1) | ((first == 0) & (second == count - 1))
    a, b, c, d = points[first], following[first], points[second], following[second]
    sides = np.array([_turn(a, b, c), _turn(a, b, d), _turn(c, d, a), _turn(c, d, b)])
    proper = (sides[0] * sides[1] < 0) & (sides[2] * sides[3] < 0)
    touching = _on(a, b, c, sides[0]) | _on(a, b, d, sides[1]) | _on(c, d, a, sides[2]) | _on(c, d, b, sides[3])
    ahead = (second - first == 1)[:, None]  # of neighbours the common vertex is b, else, at the end of the loop, a
    common = np.where(ahead, b, a)
    u, v = np.where(ahead, a, b) - common, np.where(ahead, d, c) - common
    folded = beside & (u[:, 0] * v[:, 1] == u[:, 1] * v[:, 0]) & ((u * v).sum(axis=1) > 0)
    return np.asarray(pairs[(~beside & (proper | touching)) | folded], np.int64)


def _turn(a: Floats, b: Floats, c: Floats) -> Floats:
    """Twice the signed area of the triangles a b c, (k,)."""
    return (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])


def _on(a: Floats, b: Floats, c: Floats, turn: Floats) -> np.ndarray:
    """Mask (k,) of the points c that lie on the segment a b."""
    return (turn == 0) & (np.minimum(a, b) <= c).all(axis=1) & (c <= np.maximum(a, b)).all(axis=1)
