"""Which of the pairs whose boxes overlap can come near each other on a straight way that both go at one pace.

Boxes say little about cloth: on a long way they hold all neighbours, which move together. Along a fixed direction m the
bodies of a pair are at least min m . x_j - max m . x_i apart. On the way x + t dx that is a concave function of t (a
least of linear functions, less a largest), so its smallest value is at one of the ends, and a pair is left out where
it exceeds |m| times the distance in question. Two directions are tried: from middle to middle, which is cheap and tells
most pairs apart, and between the closest points before, which tells apart whatever stays as it is.
"""

import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.compiled import kernel, part
from clothsim.contact.closest import Point, dot, edge_edge_closest, minus, point_triangle_closest

ROUNDING = 1.0 + 1e-9
"""The distance is taken so much larger: products of coordinates are rounded, and a pair too many costs nothing."""


@kernel
def that_may_meet(
    first: Ints,
    second: Ints,
    a: Ints,
    b: Ints,
    labels: Ints,
    allowed: np.ndarray,
    before: Floats,
    after: Floats,
    distance: float,
) -> tuple[Ints, Ints]:
    """Those pairs of rows first (p,) of a (n, k) and second (p,) of b (m, l) that may come nearer than `distance`.

    a, b: vertices, edges or triangles as rows of before, after (N, 3) [m], where the common way begins and ends;
    distance [m]; labels (N,), allowed (L, L): which objects may touch. Pairs that share a vertex are left out.
    """
    kept = np.empty((2, len(first)), np.int64)
    count, near = 0, distance * distance
    for k in range(len(first)):
        i, j = first[k], second[k]
        if _share_a_vertex(a, i, b, j) or not allowed[labels[a[i, 0]], labels[b[j, 0]]]:
            continue
        between = minus(_middle(before, b, j), _middle(before, a, i))
        if _are_apart(between, a, i, b, j, before, after, distance):
            continue
        closest = _closest(before, a, i, b, j)
        if dot(closest, closest) <= near or not _are_apart(closest, a, i, b, j, before, after, distance):
            kept[0, count], kept[1, count], count = i, j, count + 1
    return kept[0, :count].copy(), kept[1, :count].copy()


@part
def _share_a_vertex(a: Ints, i: int, b: Ints, j: int) -> bool:
    share = False  # no branch: most neighbours do
    for k in range(a.shape[1]):
        for m in range(b.shape[1]):
            share |= a[i, k] == b[j, m]
    return share


@part
def _are_apart(m: Point, a: Ints, i: int, b: Ints, j: int, before: Floats, after: Floats, distance: float) -> bool:
    """Whether b[j] lies further than `distance` from a[i] along m, before, after, and so all the way."""
    least = distance * ROUNDING * np.sqrt(dot(m, m))
    return _room(m, a, i, b, j, before) > least and _room(m, a, i, b, j, after) > least


@part
def _room(m: Point, a: Ints, i: int, b: Ints, j: int, x: Floats) -> float:
    """min m . x_b - max m . x_a, taken from the first vertex: how far away both are does not matter."""
    origin = _row(x, a[i, 0])
    farthest, nearest = 0.0, np.inf
    for k in range(1, a.shape[1]):
        farthest = max(farthest, dot(m, minus(_row(x, a[i, k]), origin)))
    for k in range(b.shape[1]):
        nearest = min(nearest, dot(m, minus(_row(x, b[j, k]), origin)))
    return nearest - farthest


@part
def _closest(x: Floats, a: Ints, i: int, b: Ints, j: int) -> Point:
    """From the point of a[i] that is closest to b[j] to the point of b[j] that is closest to a[i]."""
    if a.shape[1] == 2:
        s, t = edge_edge_closest(_row(x, a[i, 0]), _row(x, a[i, 1]), _row(x, b[j, 0]), _row(x, b[j, 1]))
        first, second = (1.0 - s, s, 0.0), (1.0 - t, t, 0.0)
    elif a.shape[1] == 1:
        corners = _row(x, b[j, 0]), _row(x, b[j, 1]), _row(x, b[j, 2])
        first, second = (1.0, 0.0, 0.0), point_triangle_closest(_row(x, a[i, 0]), *corners)
    else:
        corners = _row(x, a[i, 0]), _row(x, a[i, 1]), _row(x, a[i, 2])
        first, second = point_triangle_closest(_row(x, b[j, 0]), *corners), (1.0, 0.0, 0.0)
    return minus(_at(x, b, j, second), _at(x, a, i, first))


@part
def _at(x: Floats, elements: Ints, e: int, weights: Point) -> Point:
    """The point with these weights, taken from the first vertex."""
    origin, at = _row(x, elements[e, 0]), (0.0, 0.0, 0.0)
    for k in range(1, elements.shape[1]):
        r = minus(_row(x, elements[e, k]), origin)
        at = (at[0] + weights[k] * r[0], at[1] + weights[k] * r[1], at[2] + weights[k] * r[2])
    return origin[0] + at[0], origin[1] + at[1], origin[2] + at[2]


@part
def _middle(x: Floats, elements: Ints, e: int) -> Point:
    share = 1.0 / elements.shape[1]
    middle = (0.0, 0.0, 0.0)
    for k in range(elements.shape[1]):
        i = elements[e, k]
        middle = (middle[0] + share * x[i, 0], middle[1] + share * x[i, 1], middle[2] + share * x[i, 2])
    return middle


@part
def _row(x: Floats, i: int) -> Point:
    return x[i, 0], x[i, 1], x[i, 2]
