"""Distance of a pair by its closest points, the features these lie on, and its derivatives.

Scalars and tuples of them only: a view of an array costs a kernel more than the arithmetic here.

A pair has four vertices x_i: a point and a triangle, or two edges. Its closest points differ by r = sum_i g_i x_i, so q
= d^2 = |r|^2. Where they lie inside a face or an edge, g depends on up to two free parameters with the directions D_a =
dg/dp_a, and e_a = sum_i D_ai x_i = dr/dp_a is tangent to the surface: r . e_a = 0 at the minimum. Hence
    dq/dx_i     = 2 g_i r
    d2q/dx_i dx_j = 2 g_i g_j I - 2 sum_a G_ai G_aj',  G_ai = g_i t_a + c_ai r,
with e_a made orthonormal to t_a, and D_a with the same coefficients to c_a (the Schur complement of the minimisation
over p, as in any envelope theorem). One formula serves point-point, point-edge, point-triangle and edge-edge.
"""

import numpy as np

from clothsim.base.jit import part
from clothsim.base.vectors import cross, dot, minus

# Closest points of a point and a triangle and of two edges.
#
# A distance between convex bodies is the least over their features. The interior of the face (of both edges) is tried
# first, by the normal n = e1 x e2. One weight is a ratio of areas, the other a projection,
#
#     p = a + v (b - a) + w (c - a) + h n,
#     w = (b - a) x (p - a) . n / n.n,    v = (p - a - w (c - a)) . (b - a) / |b - a|^2
#
# (two ratios of areas would each err by round-off / sine of the angle, and separate near-parallel edges by that much).
# An interior solution is the closest point. Otherwise it lies on the boundary, and is the closest of the edges (of the
# four ends against the other edge): Ericson 2005, "Real-Time Collision Detection", sections 5.1.5 and 5.1.9, without
# its differences of products, which lose digits on needles. Where n is so small that its direction is uncertain,
# interior and boundary are compared. Nothing is divided by zero: degenerate triangles and edges are points or segments.
#
# A point is three floats, a tuple or an array. A weight is exactly 0 (or 1) where the closest point is not in the
# interior of its feature, so the weights alone identify the region. A common translation or scale changes only
# round-off.


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


# The pair as a whole.

PARALLEL = 1e-20
"""Squared sine of the angle of two directions below which the second is dropped."""


@part
def distance_squared(points, is_edges):
    """d^2 [m2] of a pair with these vertices."""
    _, r = closest_points(points, is_edges)
    return dot(r, r)


@part
def closest_points(points, is_edges):
    """Weights g (4) and difference r [m] of the closest points of a pair with these vertices.

    sum g_i x_i is exact only to the last digits of x, and at a small gap its direction is arbitrary. So r is taken as
    the component of a difference of vertices along the normal of the features (two edges, a face) or perpendicular to
    the one edge.
    """
    p, a, b, c = points
    if is_edges:
        s, t = edge_edge_closest(p, a, b, c)
        g = 1.0 - s, s, t - 1.0, -t
        e, f = minus(a, p), minus(c, b)
        end, other_end = (a if g[0] == 0.0 else p), (c if g[2] == 0.0 else b)
        difference = minus(end, other_end)
        if g[0] * g[1] != 0.0 and g[2] * g[3] != 0.0:
            return g, _component_along(cross(e, f), difference)
        if g[0] * g[1] != 0.0:
            return g, _component_perpendicular(difference, e)
        return g, (_component_perpendicular(difference, f) if g[2] * g[3] != 0.0 else difference)
    u, v, w = point_triangle_closest(p, a, b, c)
    g = 1.0, -u, -v, -w
    zeros = (u == 0.0) + (v == 0.0) + (w == 0.0)
    if zeros == 0:
        return g, _component_along(cross(minus(b, a), minus(c, a)), minus(p, a))
    if zeros == 1:
        first, second = (b if u == 0.0 else a), (b if w == 0.0 else c)
        return g, _component_perpendicular(minus(p, first), minus(second, first))
    return g, minus(p, a if u != 0.0 else (b if v != 0.0 else c))


@part
def _component_along(n, r):
    """Component of r along n."""
    fraction = dot(r, n) / dot(n, n)
    return fraction * n[0], fraction * n[1], fraction * n[2]


@part
def _component_perpendicular(r, e):
    """Component of r perpendicular to e."""
    fraction = dot(r, e) / dot(e, e)
    return r[0] - fraction * e[0], r[1] - fraction * e[1], r[2] - fraction * e[2]


@part
def tangent_directions(points, is_edges, g):
    """Tangents along which the closest points can move, at most two: of each whether it exists, t and c [1/m].

    c holds the weights of the pair's four vertices; the tangents are orthonormal.
    """
    i, j, k, m = _tangent_vertex_pairs(is_edges, g)
    has_first, t, c = i >= 0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0)
    has_second, u, d = k >= 0, t, c
    if has_first:
        t, c = minus(points[i], points[j]), _difference(i, j)
        t, c = _scaled(1.0 / np.sqrt(dot(t, t)), t, c)
    if has_second:
        u, d = minus(points[k], points[m]), _difference(k, m)
        length, along = dot(u, u), dot(t, u)
        u = minus(u, (along * t[0], along * t[1], along * t[2]))
        d = d[0] - along * c[0], d[1] - along * c[1], d[2] - along * c[2], d[3] - along * c[3]
        remaining = dot(u, u)
        has_second = remaining > PARALLEL * length
        u, d = _scaled(1.0 / np.sqrt(remaining), u, d)
    return (has_first, t, c), (has_second, u, d)


@part
def _difference(i, j):
    """Weights of x_i - x_j."""
    return (
        1.0 * ((i == 0) - (j == 0)),
        1.0 * ((i == 1) - (j == 1)),
        1.0 * ((i == 2) - (j == 2)),
        1.0 * ((i == 3) - (j == 3)),
    )


@part
def _scaled(scale, t, c):
    """t and c times a scale."""
    return (scale * t[0], scale * t[1], scale * t[2]), (scale * c[0], scale * c[1], scale * c[2], scale * c[3])


@part
def _tangent_vertex_pairs(is_edges, g):
    """Pairs of vertices whose differences span the tangents, at most two, -1 for none.

    For a triangle: its corners with a nonzero weight, from the first to each of the others.
    """
    if is_edges:
        if g[0] == 0.0 or g[1] == 0.0:
            return (-1, -1, -1, -1) if g[2] == 0.0 or g[3] == 0.0 else (2, 3, -1, -1)
        return (0, 1, -1, -1) if g[2] == 0.0 or g[3] == 0.0 else (0, 1, 2, 3)
    if g[1] == 0.0:
        return (-1, -1, -1, -1) if g[2] == 0.0 or g[3] == 0.0 else (2, 3, -1, -1)
    if g[2] == 0.0:
        return (-1, -1, -1, -1) if g[3] == 0.0 else (1, 3, -1, -1)
    return (1, 2, -1, -1) if g[3] == 0.0 else (1, 2, 1, 3)
