"""Self-crossing panels: borders with two sides that meet away from a common vertex."""

import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.errors import InputError
from clothsim.mesh.pattern.borders import Border
from clothsim.mesh.pattern.pattern import Panel


def refuse_self_crossing(panel: Panel, border: Border) -> None:
    """InputError for a border that crosses or touches itself, with the two edges and the place."""
    crossing = crossing_sides(border.points)
    if not len(crossing):
        return
    first, second = crossing[0]
    edges = np.searchsorted(border.starts, [first, second], side="right") - 1
    x, y = border.points[first]
    raise InputError(
        f"Panel {panel.name} crosses itself: edges {edges[0]} and {edges[1]} meet near ({x:.3g}, {y:.3g}) m.",
        "Move a vertex or a control point of one of them.",
    )


def crossing_sides(points: Floats) -> Ints:
    """Pairs (k, 2) of sides of a closed polygon that meet although they are no neighbours.

    Neighbours that fold back onto each other are found as well. A side runs from the point of its number to the next.
    """
    count = len(points)
    following = np.roll(points, -1, axis=0)
    first, second = np.triu_indices(count, 1)
    beside = (second - first == 1) | ((first == 0) & (second == count - 1))
    a, b, c, d = points[first], following[first], points[second], following[second]
    sides = np.array([_turn(a, b, c), _turn(a, b, d), _turn(c, d, a), _turn(c, d, b)])
    proper = (sides[0] * sides[1] < 0) & (sides[2] * sides[3] < 0)
    touching = _on(a, b, c, sides[0]) | _on(a, b, d, sides[1]) | _on(c, d, a, sides[2]) | _on(c, d, b, sides[3])
    ahead = (second - first == 1)[:, None]  # of neighbours the common vertex is b, else, at the end of the loop, a
    common = np.where(ahead, b, a)
    u, v = np.where(ahead, a, b) - common, np.where(ahead, d, c) - common
    folded = beside & (u[:, 0] * v[:, 1] == u[:, 1] * v[:, 0]) & ((u * v).sum(axis=1) > 0)
    return np.column_stack([first, second])[(~beside & (proper | touching)) | folded]


def _turn(a: Floats, b: Floats, c: Floats) -> Floats:
    """Twice the signed area of the triangles a b c, (k,)."""
    return (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])


def _on(a: Floats, b: Floats, c: Floats, turn: Floats) -> np.ndarray:
    """Mask (k,) of the points c that lie on the segment a b."""
    return (turn == 0) & (np.minimum(a, b) <= c).all(axis=1) & (c <= np.maximum(a, b)).all(axis=1)
