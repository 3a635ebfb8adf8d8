"""How far the points of a pair can go on straight ways before the pair has used up its share of the gap.

Additive continuous collision detection (Li, Kaufman & Jiang 2021, "Codimensional Incremental Potential Contact",
section 5), with a sharper bound for the increment. At fraction t the two bodies of a pair (point and triangle, or two
edges) have the distance d, and it must not sink below

    floor = offset + (1 - slack) min(d(0) - offset, near),

near a distance from which on nothing acts: else what slides over a body far away could not come down to it at once.

No difference of a point of one body and a point of the other changes faster than speed = max |dx_i - dx_j|, i and j
the vertices of the two bodies: t may grow by (d - floor) / speed. And along any direction m the bodies are at least
min m . (x_i - x_j) / |m| apart: t may grow as long as that is at least floor for every i, j (the directional motion
bound, Zhang, Lee & Kim 2006). Two directions are tried, which start as that of the distance: one that stays as it is,
so that a slide along a face takes one increment and not slide/gap of them; and one that turns with the features (the
normal of the face, of both edges), so that a tilt about the closest point, where far vertices of the face move fast
along the first direction, takes a few and not tilt/gap. The sum of the increments is at every moment safe; it is taken
from the very start, so that a head-on approach ends in one. Pairs take one to three, the worst seen 17 (a sliver).

Only differences of coordinates and of displacements enter, and every length is compared with one of the same pair: a
common motion costs nothing, and neither the scale nor the place matters but for the coordinates' own round-off.
"""

import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.contact.barrier_kernels import apart
from clothsim.contact.closest_points import (
    Point,
    cross,
    dot,
    edge_edge_closest,
    edge_edge_region,
    minus,
    point_triangle_closest,
    point_triangle_region,
)
from clothsim.jit import kernel, part

Points = tuple[Point, Point, Point, Point]
Direction = tuple[Point, Point, Point]
"""m0, m1, m2 of the direction m0 + tau m1 + tau^2 m2."""

ZERO = (0.0, 0.0, 0.0)

MAX_INCREMENTS = 256
"""Increments per pair; after the last one the fraction reached so far is the answer: safe, but too small."""

CLOSE = 0.01
"""Share of the usable gap, d(0) - floor, that may be left over when a pair ends."""


def point_triangle_limit(
    x: Floats, dx: Floats, pairs: Ints, offset: float, slack: float, near: float, limit: float
) -> float:
    """The largest fraction t <= limit of dx (n, 3) [m] on which no pair (point, a, b, c) sinks below its floor.

    pairs (p, 4): rows of x (n, 3) [m]. On all of [0, t] each keeps the distance offset + (1 - slack) min(d - offset,
    near) [m], d its distance at x. t is never too large; a pair gives up at most CLOSE of its usable gap. 0 where a
    pair that moves starts at the offset or nearer, or moves by NaN: the caller must say so.
    """
    return _limit(x, dx, pairs, False, offset, slack, near, limit)


def edge_edge_limit(
    x: Floats, dx: Floats, pairs: Ints, offset: float, slack: float, near: float, limit: float
) -> float:
    """`point_triangle_limit` for pairs of edges, rows (a0, a1, b0, b1)."""
    return _limit(x, dx, pairs, True, offset, slack, near, limit)


@kernel
def _limit(
    x: Floats, dx: Floats, pairs: Ints, is_edges: bool, offset: float, slack: float, near: float, limit: float
) -> float:
    for i in range(pairs.shape[0]):
        y, dy = _differences(x, pairs[i]), _differences(dx, pairs[i])
        limit = _pair_limit(y, dy, is_edges, offset, slack, near, limit)
        if limit <= 0.0:
            return 0.0
    return limit


@part
def _pair_limit(y: Points, dy: Points, is_edges: bool, offset: float, slack: float, near: float, limit: float) -> float:
    """The fraction for one pair, at most `limit`: nothing else of it depends on this, so the order of pairs is free."""
    dw = _between(dy, is_edges)
    speed = _speed(dw, is_edges)
    if speed == 0.0:
        return limit
    if not speed > 0.0:  # NaN
        return 0.0
    if apart(y, is_edges, offset + (1.0 - slack) * near + speed):  # the highest floor that there is: most pairs
        return limit
    m, distance = _separation(y, dy, is_edges)
    least = (1.0 - slack) * min(distance - offset, near)
    if not least > 0.0:
        return 0.0
    floor = offset + least
    usable = distance - floor
    t = 0.0
    for _ in range(MAX_INCREMENTS):
        w = _between(_moved(y, dy, t), is_edges)
        increment = max((distance - floor) / speed, _apart((m[0], ZERO, ZERO), w, dw, is_edges, floor, 1.0 - t))
        if t + increment < limit:
            increment = max(increment, _apart(m, w, dw, is_edges, floor, 1.0 - t))
        if t + increment >= limit:
            return limit
        if not t + increment > t:
            break
        m, distance = _separation(_moved(y, dy, t + increment), dy, is_edges)
        if distance < floor - 10.0 * CLOSE * least:  # round-off of the size of the gap: the last fraction was safe
            break
        t += increment
        if distance <= floor + CLOSE * usable:
            break
    return t


@part
def _between(y: Points, is_edges: bool) -> Points:
    """y_i - y_j of all vertices i, j of the two bodies: four of two edges; three of a point and a triangle, then 0."""
    if is_edges:
        return minus(y[0], y[2]), minus(y[0], y[3]), minus(y[1], y[2]), minus(y[1], y[3])
    return minus(y[0], y[1]), minus(y[0], y[2]), minus(y[0], y[3]), ZERO


@part
def _speed(dw: Points, is_edges: bool) -> float:
    """The largest |dx_i - dx_j| [m] over vertices i, j of the two bodies: their hulls' points are no faster."""
    squared = 0.0
    for k in range(4):
        if k < 3 or is_edges:
            squared = np.maximum(squared, dot(dw[k], dw[k]))
    return np.sqrt(squared)


@part
def _apart(m: Direction, w: Points, dw: Points, is_edges: bool, floor: float, span: float) -> float:
    """The fraction tau <= span on which the bodies stay floor apart along m(tau); 0 where they are not even now.

    With w = y_i - y_j, and |m| <= 1 + (m0 . m1) tau + (|m1|^2 / 2 + |m2|) tau^2, each i, j has a cubic that must not
    become negative, m(tau) . (w + tau dw) - floor |m|; its terms of order two and three are at least -bend tau^2.
    """
    m0, m1, m2 = m
    growth, curve = floor * dot(m0, m1), floor * (0.5 * dot(m1, m1) + np.sqrt(dot(m2, m2)))
    fraction = span
    for k in range(4):
        if k == 3 and not is_edges:
            break
        room = dot(m0, w[k]) - floor
        rate = dot(m0, dw[k]) + dot(m1, w[k]) - growth
        bend = max(0.0, curve - dot(m1, dw[k]) - dot(m2, w[k]) - min(0.0, dot(m2, dw[k])) * span)
        if not room > 0.0:
            return 0.0
        root = np.sqrt(rate * rate + 4.0 * bend * room)
        if rate < 0.0:
            fraction = min(fraction, 2.0 * room / (root - rate))
        elif bend > 0.0:
            fraction = min(fraction, 0.5 * (root + rate) / bend)
    return fraction


@part
def _separation(y: Points, dy: Points, is_edges: bool) -> tuple[Direction, float]:
    """The direction from the second body's closest point to the first's as the features turn; the distance [m].

    The difference r of two close points points anywhere. Across an edge or a face the direction comes from the
    features: at a gap of 1e-10 of the edges' length, the far ends would else seem to be on the wrong side.
    """
    if is_edges:
        e, f, de, df = minus(y[1], y[0]), minus(y[3], y[2]), minus(dy[1], dy[0]), minus(dy[3], dy[2])
        s, t = edge_edge_closest(y[0], y[1], y[2], y[3])
        r = _combine(minus(y[0], y[2]), -s, e, t, f)
        first, second = edge_edge_region(s, t)
        if first == -1:
            m = _normal(e, f, de, df, r) if second == -1 else _across(e, de, r)
        else:
            m = _across(f, df, r) if second == -1 else _unit((r, ZERO, ZERO), r)
    else:
        p, a, b, c = y
        ab, ac = minus(b, a), minus(c, a)
        u, v, w = point_triangle_closest(p, a, b, c)
        r = _combine(minus(p, a), v, ab, w, ac)
        region = point_triangle_region(u, v, w)
        if region == 6:
            m = _normal(ab, ac, minus(dy[2], dy[1]), minus(dy[3], dy[1]), r)
        elif region >= 3:
            i, j = (1, 2) if region == 3 else ((2, 3) if region == 4 else (3, 1))
            m = _across(minus(y[j], y[i]), minus(dy[j], dy[i]), r)
        else:
            m = _unit((r, ZERO, ZERO), r)
    return m, np.sqrt(dot(r, r))


@part
def _normal(e: Point, f: Point, de: Point, df: Point, r: Point) -> Direction:
    """(e + tau de) x (f + tau df), on the side of r; of near-parallel edges made exact across e, and so across f."""
    n = cross(e, f)
    across = _combine(n, dot(n, e) / dot(e, e), e, 0.0, e)
    return _unit((across, _combine(cross(e, df), -1.0, cross(de, f), 0.0, r), cross(de, df)), r)


@part
def _across(e: Point, de: Point, r: Point) -> Direction:
    """The part of r across e, turned with e about the axis r x e: (e x r) x (e + tau de)."""
    axis = cross(e, r)
    return _unit((cross(axis, e), cross(axis, de), ZERO), r)


@part
def _unit(m: Direction, r: Point) -> Direction:
    """m or -m, whichever starts on the side of r, with |m(0)| = 1."""
    length = np.sqrt(dot(m[0], m[0]))
    factor = (1.0 if dot(m[0], r) >= 0.0 else -1.0) / length
    return _scaled(factor, m[0]), _scaled(factor, m[1]), _scaled(factor, m[2])


@part
def _scaled(factor: float, a: Point) -> Point:
    return factor * a[0], factor * a[1], factor * a[2]


@part
def _combine(r: Point, v: float, e: Point, w: float, f: Point) -> Point:
    """r - v e - w f."""
    return r[0] - v * e[0] - w * f[0], r[1] - v * e[1] - w * f[1], r[2] - v * e[2] - w * f[2]


@part
def _differences(x: Floats, pair: Ints) -> Points:
    """Rows of x relative to the first one, which is subtracted exactly where they are close together."""
    o = (x[pair[0], 0], x[pair[0], 1], x[pair[0], 2])
    a = (x[pair[1], 0], x[pair[1], 1], x[pair[1], 2])
    b = (x[pair[2], 0], x[pair[2], 1], x[pair[2], 2])
    c = (x[pair[3], 0], x[pair[3], 1], x[pair[3], 2])
    return ZERO, minus(a, o), minus(b, o), minus(c, o)


@part
def _moved(y: Points, dy: Points, t: float) -> Points:
    return _step(y[0], dy[0], t), _step(y[1], dy[1], t), _step(y[2], dy[2], t), _step(y[3], dy[3], t)


@part
def _step(y: Point, dy: Point, t: float) -> Point:
    return y[0] + t * dy[0], y[1] + t * dy[1], y[2] + t * dy[2]
