"""Closest points of a point and a triangle and of two edges, and the features they lie on, for numba kernels.

A distance between convex bodies is the least over their features. The interior of the face (of both edges) is tried
first, by the normal n = e1 x e2. One weight is a ratio of areas, the other a projection,

    p = a + v (b - a) + w (c - a) + h n,
    w = (b - a) x (p - a) . n / n.n,    v = (p - a - w (c - a)) . (b - a) / |b - a|^2

(two ratios of areas would each err by round-off / sine of the angle, and separate near-parallel edges by that much). An
interior solution is the closest point. Otherwise it lies on the boundary, and is the closest of the edges (of the four
ends against the other edge): Ericson 2005, "Real-Time Collision Detection", sections 5.1.5 and 5.1.9, without its
differences of products, which lose digits on needles. Where n is so small that its direction is uncertain, interior and
boundary are compared. Nothing is divided by zero: degenerate triangles and edges are points or segments.

A point is three floats, a tuple or an array. A weight is exactly 0 (or 1) where the closest point is not in the
interior of its feature, so the weights alone identify the region. A common translation or scale changes only round-off.
"""

from clothsim.base.jit import part
from clothsim.base.vectors import cross, dot, minus

Point = tuple[float, float, float]

_THIN = 1e-6
"""Squared sine of two edges below which the interior is compared with the boundary."""


@part
def point_triangle_closest(p: Point, a: Point, b: Point, c: Point) -> Point:
    """Weights (u, v, w) of a, b, c at the triangle's point closest to p: none negative, their sum 1."""
    ab, ac, ap = minus(b, a), minus(c, a), minus(p, a)
    n = cross(ab, ac)
    nn, bb, cc = dot(n, n), dot(ab, ab), dot(ac, ac)
    best, least_squared = (1.0, 0.0, 0.0), dot(ap, ap)
    if nn > 0.0:
        w = dot(cross(ab, ap), n) / nn
        v = (dot(ap, ab) - w * dot(ac, ab)) / bb
        u = 1.0 - v - w
        if u > 0.0 and v > 0.0 and w > 0.0:
            if nn > _THIN * bb * cc:
                return u, v, w
            best, least_squared = (u, v, w), _distance_squared(ap, v, ab, w, ac)
    t = segment_closest(ap, ab)
    distance_squared = _distance_squared(ap, t, ab, 0.0, ac)
    if distance_squared <= least_squared:
        best, least_squared = (1.0 - t, t, 0.0), distance_squared
    t = segment_closest(ap, ac)
    distance_squared = _distance_squared(ap, 0.0, ab, t, ac)
    if distance_squared < least_squared:
        best, least_squared = (1.0 - t, 0.0, t), distance_squared
    bc, bp = minus(c, b), minus(p, b)
    t = segment_closest(bp, bc)
    if _distance_squared(bp, t, bc, 0.0, bc) < least_squared:
        best = (0.0, 1.0 - t, t)
    return best


@part
def edge_edge_closest(a0: Point, a1: Point, b0: Point, b1: Point) -> tuple[float, float]:
    """Parameters (s, t) in [0, 1] of the closest points a0 + s (a1 - a0) and b0 + t (b1 - b0).

    Of parallel edges, one of the closest pairs that includes an end.
    """
    e, f, r = minus(a1, a0), minus(b1, b0), minus(b0, a0)
    n = cross(e, f)
    nn, ee, ff = dot(n, n), dot(e, e), dot(f, f)
    best, least_squared = (0.0, 0.0), dot(r, r)
    if nn > 0.0:
        s = dot(cross(r, f), n) / nn
        t = (s * dot(e, f) - dot(r, f)) / ff
        if 0.0 < s < 1.0 and 0.0 < t < 1.0:
            if nn > _THIN * ee * ff:
                return s, t
            best, least_squared = (s, t), _distance_squared(r, s, e, -t, f)
    for end in (0.0, 1.0):  # an end of the first edge against the second, then vice versa
        t = segment_closest(minus((end * e[0], end * e[1], end * e[2]), r), f)
        distance_squared = _distance_squared(r, end, e, -t, f)
        if distance_squared <= least_squared:
            best, least_squared = (end, t), distance_squared
        s = segment_closest((r[0] + end * f[0], r[1] + end * f[1], r[2] + end * f[2]), e)
        distance_squared = _distance_squared(r, s, e, -end, f)
        if distance_squared < least_squared:
            best, least_squared = (s, end), distance_squared
    return best


@part
def point_triangle_region(u: float, v: float, w: float) -> int:
    """Feature of weights from `point_triangle_closest`: 0, 1, 2 vertex a, b, c; 3, 4, 5 edge ab, bc, ca; 6 the face."""
    if w == 0.0:
        if v == 0.0:
            return 0
        return 1 if u == 0.0 else 3
    if u == 0.0:
        return 2 if v == 0.0 else 4
    return 5 if v == 0.0 else 6


@part
def edge_edge_region(s: float, t: float) -> tuple[int, int]:
    """Feature on each edge of parameters from `edge_edge_closest`: -1 the interior, 0 the first end, 1 the second."""
    return _endpoint(s), _endpoint(t)


@part
def segment_closest(r: Point, e: Point) -> float:
    """Parameter t in [0, 1] of the point t e closest to r; 0 where e has no length."""
    along, length = dot(r, e), dot(e, e)
    if not along > 0.0:
        return 0.0
    return 1.0 if along >= length else along / length


@part
def _endpoint(t: float) -> int:
    """0 or 1 at an end of an edge, -1 in its interior."""
    if t == 0.0:
        return 0
    return 1 if t == 1.0 else -1


@part
def _distance_squared(r: Point, s: float, e: Point, t: float, f: Point) -> float:
    """|r - s e - t f|^2."""
    x, y, z = r[0] - s * e[0] - t * f[0], r[1] - s * e[1] - t * f[1], r[2] - s * e[2] - t * f[2]
    return x * x + y * y + z * z
