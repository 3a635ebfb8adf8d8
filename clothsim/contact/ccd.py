"""How far the points of a pair can go on straight ways before the pair has used up its share of the gap.

Additive continuous collision detection (Li, Kaufman & Jiang 2021, "Codimensional Incremental Potential Contact",
section 5), with a sharper bound for the increment. At fraction t the two bodies of a pair (point and triangle, or two
edges) have the distance d, and it must not sink below

    floor = offset + (1 - slack) (d(0) - offset).

No difference of a point of one body and a point of the other changes faster than speed = max |dx_i - dx_j|, i and j
the vertices of the two bodies: t may grow by (d - floor) / speed. And along any unit vector n the bodies stay apart
by min n . (x_i - x_j): t may grow as long as every n . (x_i + t dx_i - x_j - t dx_j) is at least floor (the
directional motion bound, Zhang, Lee & Kim 2006). With n the direction of the distance the second bound is the larger
one but for round-off, and a slide along a face takes one increment where the first takes slide/gap of them. The sum of
the increments is at every moment safe; it is taken from the very start, so that a head-on approach ends in one.

Only differences of coordinates and of displacements enter, and every length is compared with one of the same pair: a
common motion costs nothing, and neither the scale nor the place matters but for the coordinates' own round-off.
"""

import numpy as np
from numba import njit

from clothsim.arrays import Floats, Ints
from clothsim.contact.closest import (
    Point,
    cross,
    dot,
    edge_edge_closest,
    edge_edge_region,
    minus,
    point_triangle_closest,
    point_triangle_region,
)

Points = tuple[Point, Point, Point, Point]

MAX_INCREMENTS = 256
"""Increments per pair; after the last one the fraction reached so far is the answer: safe, but too small."""

CLOSE = 0.01
"""Share of the usable gap, slack (d(0) - offset), that may be left over when a pair ends."""


@njit(cache=True, error_model="numpy")
def point_triangle_limit(x: Floats, dx: Floats, pairs: Ints, offset: float, slack: float, limit: float) -> float:
    """The largest fraction t <= limit of dx (n, 3) [m] on which no pair (point, a, b, c) sinks below its floor.

    pairs (p, 4): rows of x (n, 3) [m]. On all of [0, t] each keeps the distance offset + (1 - slack) (d - offset) [m],
    d its distance at x. t is never too large; a pair gives up at most CLOSE of its usable gap. 0 where a pair that
    moves starts at the offset or nearer: the caller must say so.
    """
    return _limit(x, dx, pairs, 1, offset, slack, limit)


@njit(cache=True, error_model="numpy")
def edge_edge_limit(x: Floats, dx: Floats, pairs: Ints, offset: float, slack: float, limit: float) -> float:
    """`point_triangle_limit` for pairs of edges, rows (a0, a1, b0, b1)."""
    return _limit(x, dx, pairs, 2, offset, slack, limit)


@njit(cache=True, error_model="numpy")
def _limit(x: Floats, dx: Floats, pairs: Ints, split: int, offset: float, slack: float, limit: float) -> float:
    for i in range(pairs.shape[0]):
        limit = _pair_limit(_differences(x, pairs[i]), _differences(dx, pairs[i]), split, offset, slack, limit)
        if limit <= 0.0:
            return 0.0
    return limit


@njit(cache=True, error_model="numpy")
def _pair_limit(y: Points, dy: Points, split: int, offset: float, slack: float, limit: float) -> float:
    """The fraction for one pair: the first `split` of the points are one body, the others the other."""
    speed = _speed(dy, split)
    if speed == 0.0:
        return limit
    n, distance = _separation(y, split)
    usable = slack * (distance - offset)
    if not usable > 0.0:
        return 0.0
    floor = distance - usable
    t = 0.0
    for _ in range(MAX_INCREMENTS):
        increment = max((distance - floor) / speed, _directional(n, _moved(y, dy, t), dy, split, floor))
        if not t + increment > t:
            break
        if t + increment >= limit:
            return limit
        n, distance = _separation(_moved(y, dy, t + increment), split)
        if distance < floor - CLOSE * usable:  # round-off of the size of the gap: the last fraction was safe
            break
        t += increment
        if distance <= floor + CLOSE * usable:
            break
    return t


@njit(cache=True, error_model="numpy")
def _speed(dy: Points, split: int) -> float:
    """The largest |dx_i - dx_j| [m] over vertices i, j of the two bodies: their hulls' points are no faster."""
    squared = 0.0
    for i in range(split):
        for j in range(split, 4):
            r = minus(dy[i], dy[j])
            squared = max(squared, dot(r, r))
    return np.sqrt(squared)


@njit(cache=True, error_model="numpy")
def _directional(n: Point, y: Points, dy: Points, split: int, floor: float) -> float:
    """The fraction on which the bodies stay apart by floor along n; 0 where they are not even now."""
    fraction = np.inf
    for i in range(split):
        for j in range(split, 4):
            room = dot(n, minus(y[i], y[j])) - floor
            rate = dot(n, minus(dy[i], dy[j]))
            if not room > 0.0:
                return 0.0
            if rate < 0.0:
                fraction = min(fraction, room / -rate)
    return fraction


@njit(cache=True, error_model="numpy")
def _separation(y: Points, split: int) -> tuple[Point, float]:
    """Unit vector from the closest point of the second body to that of the first, and their distance [m].

    The difference of two close points points anywhere. Across an edge or a face it is made exact by the normal of
    the features: at a gap of 1e-10 of the edges' length, the far ends would else seem to be on the wrong side.
    """
    if split == 1:
        p, a, b, c = y
        ab, ac, ap = minus(b, a), minus(c, a), minus(p, a)
        u, v, w = point_triangle_closest(p, a, b, c)
        r = _combine(ap, v, ab, w, ac)
        region = point_triangle_region(u, v, w)
        if region == 6:
            n = _along(cross(ab, ac), r)
        elif region >= 3:
            n = _across(r, ab if region == 3 else (ac if region == 5 else minus(c, b)))
        else:
            n = r
    else:
        a0, a1, b0, b1 = y
        e, f = minus(a1, a0), minus(b1, b0)
        s, t = edge_edge_closest(a0, a1, b0, b1)
        r = _combine(minus(a0, b0), -s, e, t, f)
        first, second = edge_edge_region(s, t)
        if first == -1:
            n = _along(cross(e, f), r) if second == -1 else _across(r, e)
        else:
            n = _across(r, f) if second == -1 else r
    length = np.sqrt(dot(n, n))
    return (n[0] / length, n[1] / length, n[2] / length), np.sqrt(dot(r, r))


@njit(cache=True, error_model="numpy")
def _along(n: Point, r: Point) -> Point:
    """n or -n, whichever points as r does."""
    return n if dot(n, r) >= 0.0 else (-n[0], -n[1], -n[2])


@njit(cache=True, error_model="numpy")
def _across(r: Point, e: Point) -> Point:
    """The part of r across e."""
    along = dot(r, e) / dot(e, e)
    return r[0] - along * e[0], r[1] - along * e[1], r[2] - along * e[2]


@njit(cache=True, error_model="numpy")
def _combine(r: Point, v: float, e: Point, w: float, f: Point) -> Point:
    """r - v e - w f."""
    return r[0] - v * e[0] - w * f[0], r[1] - v * e[1] - w * f[1], r[2] - v * e[2] - w * f[2]


@njit(cache=True, error_model="numpy")
def _differences(x: Floats, pair: Ints) -> Points:
    """Rows of x relative to the first one, which is subtracted exactly where they are close together."""
    o = (x[pair[0], 0], x[pair[0], 1], x[pair[0], 2])
    a = (x[pair[1], 0], x[pair[1], 1], x[pair[1], 2])
    b = (x[pair[2], 0], x[pair[2], 1], x[pair[2], 2])
    c = (x[pair[3], 0], x[pair[3], 1], x[pair[3], 2])
    return (0.0, 0.0, 0.0), minus(a, o), minus(b, o), minus(c, o)


@njit(cache=True, error_model="numpy")
def _moved(y: Points, dy: Points, t: float) -> Points:
    return _step(y[0], dy[0], t), _step(y[1], dy[1], t), _step(y[2], dy[2], t), _step(y[3], dy[3], t)


@njit(cache=True, error_model="numpy")
def _step(y: Point, dy: Point, t: float) -> Point:
    return y[0] + t * dy[0], y[1] + t * dy[1], y[2] + t * dy[2]
