"""Pairs on linear paths: additive continuous collision detection (CCD), and culling by separating directions.

Li, Kaufman & Jiang 2021, "Codimensional Incremental Potential Contact", section 5, with a sharper bound for the
increment. At fraction t the two bodies of a pair (point and triangle, or two edges) have the distance d, which must not
fall below

    floor = offset + (1 - slack) min(d(0) - offset, d_hat),

with d_hat the range of the barrier: else a vertex sliding over a distant body could not descend to it in one step.

No difference of a point of one body and a point of the other changes faster than speed = max |dx_i - dx_j|, i and j the
vertices of the two bodies: t may grow by (d - floor) / speed. And along any direction m the bodies are at least min m .
(x_i - x_j) / |m| apart: t may grow as long as that is at least floor for every i, j (the directional motion bound,
Zhang, Lee & Kim 2006). Two directions are tried, both starting as that of the distance: a fixed one, so that a slide
along a face takes one increment and not slide/gap of them; and one that rotates with the features (the normal of the
face, of both edges), so that a tilt about the closest point, where far vertices of the face move fast along the first
direction, takes a few and not tilt/gap. The sum of the increments is safe at any time; it is taken from the very start,
so that a head-on approach ends in one. Pairs take one to three, the worst observed 17 (a sliver).

Only differences of coordinates and of displacements enter, and every length is compared with one of the same pair: a
common translation has no effect, and neither scale nor position matters but for the coordinates' own round-off.
"""

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.jit import kernel, part
from clothsim.base.vectors import cross, dot, minus, times
from clothsim.physics.contact.barrier_kernels import boxes_apart
from clothsim.physics.contact.distance import (
    Point,
    edge_edge_closest,
    edge_edge_region,
    point_triangle_closest,
    point_triangle_region,
)

# Culling of box pairs by separating directions along linear paths.
#
# Boxes are loose for cloth: on a long path they overlap those of all neighbours, which move together. Along a fixed
# direction m the bodies of a pair are at least min m . x_j - max m . x_i apart. On the path x + t dx that is a concave
# function of t (a minimum of linear functions, less a maximum), so its smallest value is at one of the ends, and a pair
# is culled where it exceeds |m| times the distance in question. Two directions are tried: between the centroids, which
# is cheap and separates most pairs, and between the closest points at the start, which separates all pairs without
# relative motion.


ROUND_OFF_FACTOR = 1.0 + 1e-9
"""Enlargement of the distance: products of coordinates are rounded, and an additional pair costs nothing."""

Vertices = tuple[Point, Point, Point, Point]


@part
def separated_by_centroids(x: Vertices, y: Vertices, is_edges: bool, distance_squared: float) -> bool:
    """True where the direction between the centroids proves that two edges, or a point and a triangle, stay apart.

    x, y: their vertices at the start and end of the path; distance_squared: of the distance in question, times
    ROUND_OFF_FACTOR^2 [m2].
    """
    return _separated_along(_centroid_difference(x, is_edges), x, y, is_edges, distance_squared)


@part
def distance_unless_separated(x: Vertices, y: Vertices, is_edges: bool, distance_squared: float) -> float:
    """Distance at the start of the path [m]; -1 where the closest points prove that the two stay apart.

    A non-finite distance is returned as 0: they may be anywhere.
    """
    m = _closest_difference(x, is_edges)
    if dot(m, m) <= distance_squared or not _separated_along(m, x, y, is_edges, distance_squared):
        length = np.sqrt(dot(m, m))
        return length if length >= 0.0 else 0.0
    return -1.0


@part
def vertex_rows(a: Ints, i: int, b: Ints, j: int, is_edges: bool) -> tuple[int, int, int, int]:
    """Rows of x of both elements: of two edges, or of a point and a triangle."""
    if is_edges:
        return a[i, 0], a[i, 1], b[j, 0], b[j, 1]
    return a[i, 0], b[j, 0], b[j, 1], b[j, 2]


@part
def have_common_vertex(rows: tuple[int, int, int, int], is_edges: bool) -> bool:
    """True where two edges, or a point and a triangle, have a vertex in common."""
    i, j, k, m = rows
    if is_edges:
        return (i == k) | (i == m) | (j == k) | (j == m)
    return (i == j) | (i == k) | (i == m)


@part
def relative_vertices(x: Floats, rows: tuple[int, int, int, int]) -> Vertices:
    """Vertices relative to the first one: a common translation has no effect."""
    i, j, k, m = rows
    o = x[i, 0], x[i, 1], x[i, 2]
    return (
        (0.0, 0.0, 0.0),
        (x[j, 0] - o[0], x[j, 1] - o[1], x[j, 2] - o[2]),
        (x[k, 0] - o[0], x[k, 1] - o[1], x[k, 2] - o[2]),
        (x[m, 0] - o[0], x[m, 1] - o[1], x[m, 2] - o[2]),
    )


@part
def _centroid_difference(x: Vertices, is_edges: bool) -> Point:
    """Difference of the centroids, times the number of vertices of one element."""
    _, p, q, r = x
    if is_edges:
        return q[0] + r[0] - p[0], q[1] + r[1] - p[1], q[2] + r[2] - p[2]
    return p[0] + q[0] + r[0], p[1] + q[1] + r[1], p[2] + q[2] + r[2]


@part
def _separated_along(m: Point, x: Vertices, y: Vertices, is_edges: bool, distance_squared: float) -> bool:
    """True where the two are further apart along m than the given distance at both ends, and so on the path."""
    gap = min(_projected_gap(m, x, is_edges), _projected_gap(m, y, is_edges))
    return (gap > 0.0) & (gap * gap > distance_squared * dot(m, m))


@part
def _projected_gap(m: Point, x: Vertices, is_edges: bool) -> float:
    """min m . x_b - max m . x_a."""
    p, q, r = dot(m, x[1]), dot(m, x[2]), dot(m, x[3])
    return min(q, r) - max(p, 0.0) if is_edges else min(p, q, r)


@part
def _closest_difference(x: Vertices, is_edges: bool) -> Point:
    """Vector from the first element's closest point to that of the second."""
    if is_edges:
        s, t = edge_edge_closest(x[0], x[1], x[2], x[3])
        return _weighted(x, -s, 1.0 - t, t)
    u, v, w = point_triangle_closest(x[0], x[1], x[2], x[3])
    return _weighted(x, u, v, w)


@part
def _weighted(x: Vertices, u: float, v: float, w: float) -> Point:
    _, p, q, r = x
    return (
        u * p[0] + v * q[0] + w * r[0],
        u * p[1] + v * q[1] + w * r[1],
        u * p[2] + v * q[2] + w * r[2],
    )


Points = tuple[Point, Point, Point, Point]
Direction = tuple[Point, Point, Point]
"""m0, m1, m2 of the direction m0 + tau m1 + tau^2 m2."""

ZERO = (0.0, 0.0, 0.0)

MAX_INCREMENTS = 256
"""Increments per pair; after the last one the fraction reached is returned: safe, but too small."""

RESOLVED = 64 * float(np.finfo(np.float64).eps)
"""Least gap over the largest coordinate of a pair: closer, round-off decides on which side of a face a point lies."""

TOLERANCE = 0.01
"""Fraction of the usable gap, d(0) - floor, that may remain when a pair ends."""


def point_triangle_limit(
    x: Floats, dx: Floats, pairs: Ints, offset: float, slack: float, d_hat: float, limit: float
) -> float:
    """Largest fraction t <= limit of dx on which no point-triangle pair falls below its floor.

    Parameters
    ----------
    x, dx : (n, 3) array
        Positions and displacements [m].
    pairs : (p, 4) int array
        Rows (point, a, b, c) of x.
    offset : float
        Distance that no pair may reach [m].
    slack : float
        Fraction of the gap that may be used up.
    d_hat : float
        Gap beyond which the floor grows no further [m].
    limit : float
        Upper bound of the fraction.

    Returns
    -------
    float
        t, never too large; a pair gives up at most TOLERANCE of its usable gap. 0 where a moving pair starts at the
        offset or closer, or so little farther that round-off hides it (RESOLVED), or moves by NaN: the caller must
        report it.
    """
    return _collision_free_fraction(x, dx, pairs, False, offset, slack, d_hat, limit)


def edge_edge_limit(
    x: Floats, dx: Floats, pairs: Ints, offset: float, slack: float, d_hat: float, limit: float
) -> float:
    """`point_triangle_limit` for pairs of edges, rows (a0, a1, b0, b1)."""
    return _collision_free_fraction(x, dx, pairs, True, offset, slack, d_hat, limit)


@kernel
def _collision_free_fraction(
    x: Floats, dx: Floats, pairs: Ints, is_edges: bool, offset: float, slack: float, d_hat: float, limit: float
) -> float:
    """Least fraction over all pairs."""
    for i in range(pairs.shape[0]):
        y, dy = _differences(x, pairs[i]), _differences(dx, pairs[i])
        least = RESOLVED * _largest_coordinate(x, pairs[i])
        limit = _pair_limit(y, dy, is_edges, offset, slack, d_hat, least, limit)
        if limit <= 0.0:
            return 0.0
    return limit


@part
def _largest_coordinate(x: Floats, rows: Ints) -> float:
    """Largest magnitude of a coordinate of four rows of x [m]."""
    largest = 0.0
    for row in rows:
        for k in range(3):
            largest = max(largest, abs(x[row, k]))
    return largest


@part
def _pair_limit(
    y: Points, dy: Points, is_edges: bool, offset: float, slack: float, d_hat: float, least: float, limit: float
) -> float:
    """Fraction for one pair, at most `limit`; otherwise independent of it, so the order of the pairs is arbitrary.

    least: smallest gap that round-off does not hide [m].
    """
    dw = _vertex_differences(dy, is_edges)
    speed = _speed(dw, is_edges)
    if speed == 0.0:
        return limit
    if not speed > 0.0:  # NaN
        return 0.0
    if boxes_apart(y, is_edges, offset + (1.0 - slack) * d_hat + speed):  # the highest possible floor: most pairs
        return limit
    m, distance = _separating_direction(y, dy, is_edges)
    if not distance - offset > least:
        return 0.0
    clearance = (1.0 - slack) * min(distance - offset, d_hat)
    floor = offset + clearance
    usable = distance - floor
    t = 0.0
    for _ in range(MAX_INCREMENTS):
        w = _vertex_differences(_displaced(y, dy, t), is_edges)
        increment = max(
            (distance - floor) / speed, _separated_fraction((m[0], ZERO, ZERO), w, dw, is_edges, floor, 1.0 - t)
        )
        if t + increment < limit:
            increment = max(increment, _separated_fraction(m, w, dw, is_edges, floor, 1.0 - t))
        if t + increment >= limit:
            return limit
        if not t + increment > t:
            break
        m, distance = _separating_direction(_displaced(y, dy, t + increment), dy, is_edges)
        if distance < floor - 10.0 * TOLERANCE * clearance:  # round-off as large as the gap: the last fraction was safe
            break
        t += increment
        if distance <= floor + TOLERANCE * usable:
            break
    return t


@part
def _vertex_differences(y: Points, is_edges: bool) -> Points:
    """y_i - y_j of all vertices i, j of the two bodies: four of two edges; three of a point and a triangle, then 0."""
    if is_edges:
        return minus(y[0], y[2]), minus(y[0], y[3]), minus(y[1], y[2]), minus(y[1], y[3])
    return minus(y[0], y[1]), minus(y[0], y[2]), minus(y[0], y[3]), ZERO


@part
def _speed(dw: Points, is_edges: bool) -> float:
    """Largest |dx_i - dx_j| [m] over vertices i, j of the two bodies: points of their hulls are no faster."""
    speed_squared = 0.0
    for k in range(4):
        if k < 3 or is_edges:
            speed_squared = np.maximum(speed_squared, dot(dw[k], dw[k]))
    return np.sqrt(speed_squared)


@part
def _separated_fraction(m: Direction, w: Points, dw: Points, is_edges: bool, floor: float, span: float) -> float:
    """Fraction tau <= span on which the bodies stay floor apart along m(tau); 0 where they are not at tau = 0.

    With w = y_i - y_j, and |m| <= 1 + (m0 . m1) tau + (|m1|^2 / 2 + |m2|) tau^2, each i, j has a cubic that must not
    become negative, m(tau) . (w + tau dw) - floor |m|; its terms of order two and three are at least -curvature tau^2.
    """
    m0, m1, m2 = m
    growth, curve = floor * dot(m0, m1), floor * (0.5 * dot(m1, m1) + np.sqrt(dot(m2, m2)))
    fraction = span
    for k in range(4):
        if k == 3 and not is_edges:
            break
        margin = dot(m0, w[k]) - floor
        rate = dot(m0, dw[k]) + dot(m1, w[k]) - growth
        curvature = max(0.0, curve - dot(m1, dw[k]) - dot(m2, w[k]) - min(0.0, dot(m2, dw[k])) * span)
        if not margin > 0.0:
            return 0.0
        root = np.sqrt(rate * rate + 4.0 * curvature * margin)
        if rate < 0.0:
            fraction = min(fraction, 2.0 * margin / (root - rate))
        elif curvature > 0.0:
            fraction = min(fraction, 0.5 * (root + rate) / curvature)
    return fraction


@part
def _separating_direction(y: Points, dy: Points, is_edges: bool) -> tuple[Direction, float]:
    """Direction from the second body's closest point to the first's as the features rotate; the distance [m].

    The difference r of two nearby points has an arbitrary direction. Across an edge or a face the direction comes from
    the features: at a gap of 1e-10 of the edges' length, the far ends would else seem to be on the wrong side.
    """
    if is_edges:
        e, f, de, df = minus(y[1], y[0]), minus(y[3], y[2]), minus(dy[1], dy[0]), minus(dy[3], dy[2])
        s, t = edge_edge_closest(y[0], y[1], y[2], y[3])
        r = _combine(minus(y[0], y[2]), -s, e, t, f)
        first, second = edge_edge_region(s, t)
        if first == -1:
            m = _normal_direction(e, f, de, df, r) if second == -1 else _edge_direction(e, de, r)
        else:
            m = _edge_direction(f, df, r) if second == -1 else _normalized((r, ZERO, ZERO), r)
    else:
        p, a, b, c = y
        ab, ac = minus(b, a), minus(c, a)
        u, v, w = point_triangle_closest(p, a, b, c)
        r = _combine(minus(p, a), v, ab, w, ac)
        region = point_triangle_region(u, v, w)
        if region == 6:
            m = _normal_direction(ab, ac, minus(dy[2], dy[1]), minus(dy[3], dy[1]), r)
        elif region >= 3:
            i, j = (1, 2) if region == 3 else ((2, 3) if region == 4 else (3, 1))
            m = _edge_direction(minus(y[j], y[i]), minus(dy[j], dy[i]), r)
        else:
            m = _normalized((r, ZERO, ZERO), r)
    return m, np.sqrt(dot(r, r))


@part
def _normal_direction(e: Point, f: Point, de: Point, df: Point, r: Point) -> Direction:
    """(e + tau de) x (f + tau df), on the side of r; for near-parallel edges orthogonalised to e, and so to f."""
    n = cross(e, f)
    perpendicular = _combine(n, dot(n, e) / dot(e, e), e, 0.0, e)
    return _normalized((perpendicular, _combine(cross(e, df), -1.0, cross(de, f), 0.0, r), cross(de, df)), r)


@part
def _edge_direction(e: Point, de: Point, r: Point) -> Direction:
    """Component of r perpendicular to e, rotated with e about the axis r x e: (e x r) x (e + tau de)."""
    axis = cross(e, r)
    return _normalized((cross(axis, e), cross(axis, de), ZERO), r)


@part
def _normalized(m: Direction, r: Point) -> Direction:
    """m or -m, whichever starts on the side of r, with |m(0)| = 1."""
    length = np.sqrt(dot(m[0], m[0]))
    factor = (1.0 if dot(m[0], r) >= 0.0 else -1.0) / length
    return times(factor, m[0]), times(factor, m[1]), times(factor, m[2])


@part
def _combine(r: Point, v: float, e: Point, w: float, f: Point) -> Point:
    """r - v e - w f."""
    return r[0] - v * e[0] - w * f[0], r[1] - v * e[1] - w * f[1], r[2] - v * e[2] - w * f[2]


@part
def _differences(x: Floats, pair: Ints) -> Points:
    """Rows of x relative to the first one, an exact subtraction where they are close together."""
    o = (x[pair[0], 0], x[pair[0], 1], x[pair[0], 2])
    a = (x[pair[1], 0], x[pair[1], 1], x[pair[1], 2])
    b = (x[pair[2], 0], x[pair[2], 1], x[pair[2], 2])
    c = (x[pair[3], 0], x[pair[3], 1], x[pair[3], 2])
    return ZERO, minus(a, o), minus(b, o), minus(c, o)


@part
def _displaced(y: Points, dy: Points, t: float) -> Points:
    """Vertices at fraction t."""
    return (
        _displaced_point(y[0], dy[0], t),
        _displaced_point(y[1], dy[1], t),
        _displaced_point(y[2], dy[2], t),
        _displaced_point(y[3], dy[3], t),
    )


@part
def _displaced_point(y: Point, dy: Point, t: float) -> Point:
    """A vertex at fraction t."""
    return y[0] + t * dy[0], y[1] + t * dy[1], y[2] + t * dy[2]
