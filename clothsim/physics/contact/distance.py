"""Distance of a pair by its closest points, and its derivatives.

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
from clothsim.physics.contact.closest_points import edge_edge_closest, point_triangle_closest

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
