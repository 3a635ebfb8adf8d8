"""Which of the pairs whose boxes overlap can come near each other on a straight way that both go at one pace.

Boxes say little about cloth: on a long way they hold all neighbours, which move together. Along a fixed direction m the
bodies of a pair are at least min m . x_j - max m . x_i apart. On the way x + t dx that is a concave function of t (a
least of linear functions, less a largest), so its smallest value is at one of the ends, and a pair is left out where
it exceeds |m| times the distance in question. Two directions are tried: from middle to middle, which is cheap and tells
most pairs apart, and between the closest points before, which tells apart whatever stays as it is.
"""

import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.contact.closest_points import Point, dot, edge_edge_closest, point_triangle_closest
from clothsim.jit import part

ROUNDING = 1.0 + 1e-9
"""The distance is taken so much larger: products of coordinates are rounded, and a pair too many costs nothing."""

Corners = tuple[Point, Point, Point, Point]


@part
def are_kept_apart(x: Corners, y: Corners, is_edges: bool, squared: float) -> bool:
    """Whether the direction from middle to middle tells that two edges, or a point and a triangle, never come near.

    x, y: their corners where the way begins and ends; squared: of the distance in question, times ROUNDING^2 [m2].
    """
    return _are_apart(_between(x, is_edges), x, y, is_edges, squared)


@part
def distance_if_near(x: Corners, y: Corners, is_edges: bool, squared: float) -> float:
    """How far apart the two are where the way begins [m], and -1 where the closest points tell that they never meet.

    A distance that is no number is 0: they may be anywhere.
    """
    m = _closest(x, is_edges)
    if dot(m, m) <= squared or not _are_apart(m, x, y, is_edges, squared):
        length = np.sqrt(dot(m, m))
        return length if length >= 0.0 else 0.0
    return -1.0


@part
def rows_of(a: Ints, i: int, b: Ints, j: int, is_edges: bool) -> tuple[int, int, int, int]:
    """The rows of x of both: of two edges, or of a point and a triangle."""
    if is_edges:
        return a[i, 0], a[i, 1], b[j, 0], b[j, 1]
    return a[i, 0], b[j, 0], b[j, 1], b[j, 2]


@part
def share_a_vertex(rows: tuple[int, int, int, int], is_edges: bool) -> bool:
    """Whether two edges, or a point and a triangle, do."""
    i, j, k, m = rows
    if is_edges:
        return (i == k) | (i == m) | (j == k) | (j == m)
    return (i == j) | (i == k) | (i == m)


@part
def corners(x: Floats, rows: tuple[int, int, int, int]) -> Corners:
    """The corners from the first one on: how far away all are does not matter."""
    i, j, k, m = rows
    o = x[i, 0], x[i, 1], x[i, 2]
    return (
        (0.0, 0.0, 0.0),
        (x[j, 0] - o[0], x[j, 1] - o[1], x[j, 2] - o[2]),
        (x[k, 0] - o[0], x[k, 1] - o[1], x[k, 2] - o[2]),
        (x[m, 0] - o[0], x[m, 1] - o[1], x[m, 2] - o[2]),
    )


@part
def _between(x: Corners, is_edges: bool) -> Point:
    """From the middle of the one to that of the other, so many times as there are corners."""
    _, p, q, r = x
    if is_edges:
        return q[0] + r[0] - p[0], q[1] + r[1] - p[1], q[2] + r[2] - p[2]
    return p[0] + q[0] + r[0], p[1] + q[1] + r[1], p[2] + q[2] + r[2]


@part
def _are_apart(m: Point, x: Corners, y: Corners, is_edges: bool, squared: float) -> bool:
    """Whether the two lie further apart along m than the root of `squared`, before, after, and so all the way."""
    room = min(_room(m, x, is_edges), _room(m, y, is_edges))
    return (room > 0.0) & (room * room > squared * dot(m, m))


@part
def _room(m: Point, x: Corners, is_edges: bool) -> float:
    """min m . x_b - max m . x_a."""
    p, q, r = dot(m, x[1]), dot(m, x[2]), dot(m, x[3])
    return min(q, r) - max(p, 0.0) if is_edges else min(p, q, r)


@part
def _closest(x: Corners, is_edges: bool) -> Point:
    """From the point of the one that is closest to the other to the point of the other that is closest to it."""
    if is_edges:
        s, t = edge_edge_closest(x[0], x[1], x[2], x[3])
        return _weighted(x, -s, 1.0 - t, t)
    u, v, w = point_triangle_closest(x[0], x[1], x[2], x[3])
    return _weighted(x, u, v, w)


@part
def _weighted(x: Corners, u: float, v: float, w: float) -> Point:
    _, p, q, r = x
    return (
        u * p[0] + v * q[0] + w * r[0],
        u * p[1] + v * q[1] + w * r[1],
        u * p[2] + v * q[2] + w * r[2],
    )
