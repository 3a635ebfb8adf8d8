"""The distance of a pair by its closest points, and its derivatives.

Floats and tuples of them: a view of an array costs a kernel more than what is done with it here.

A pair has four vertices x_i: a point and a triangle, or two edges. Its closest points differ by r = sum_i g_i x_i, so
q = d^2 = |r|^2. Where they lie inside a face or an edge, g depends on up to two free parameters with the directions
D_a = dg/dp_a, and e_a = sum_i D_ai x_i = dr/dp_a is tangent to the surface: r . e_a = 0 at the minimum. Hence
    dq/dx_i     = 2 g_i r
    d2q/dx_i dx_j = 2 g_i g_j I - 2 sum_a G_ai G_aj',  G_ai = g_i t_a + c_ai r,
with e_a made orthonormal to t_a, and D_a with the same numbers to c_a (the Schur complement of the minimisation over p,
as in any envelope theorem). One formula serves point-point, point-edge, point-triangle and edge-edge.
"""

import numpy as np

from clothsim.contact.closest_points import cross, dot, edge_edge_closest, minus, point_triangle_closest
from clothsim.jit import part

FLAT = 1e-20
"""Square of the sine of the angle of two directions below which the second adds nothing."""


@part
def squared_distance(points, is_edges):
    """d^2 [m2] of a pair with these vertices."""
    _, r = closest_points(points, is_edges)
    return dot(r, r)


@part
def closest_points(points, is_edges):
    """g and r [m] of a pair with these vertices.

    sum g_i x_i is good to the last digits of x only, and at a small gap points anywhere. So r is taken as the part of
    a difference of vertices along the normal of the features (two edges, a face) or across the one edge.
    """
    p, a, b, c = points
    if is_edges:
        s, t = edge_edge_closest(p, a, b, c)
        g = 1.0 - s, s, t - 1.0, -t
        e, f = minus(a, p), minus(c, b)
        one, other = (a if g[0] == 0.0 else p), (c if g[2] == 0.0 else b)
        between = minus(one, other)
        if g[0] * g[1] != 0.0 and g[2] * g[3] != 0.0:
            return g, _along(cross(e, f), between)
        if g[0] * g[1] != 0.0:
            return g, _across(between, e)
        return g, (_across(between, f) if g[2] * g[3] != 0.0 else between)
    u, v, w = point_triangle_closest(p, a, b, c)
    g = 1.0, -u, -v, -w
    zeros = (u == 0.0) + (v == 0.0) + (w == 0.0)
    if zeros == 0:
        return g, _along(cross(minus(b, a), minus(c, a)), minus(p, a))
    if zeros == 1:
        first, second = (b if u == 0.0 else a), (b if w == 0.0 else c)
        return g, _across(minus(p, first), minus(second, first))
    return g, minus(p, a if u != 0.0 else (b if v != 0.0 else c))


@part
def _along(n, r):
    """The part of r along n."""
    share = dot(r, n) / dot(n, n)
    return share * n[0], share * n[1], share * n[2]


@part
def _across(r, e):
    """The part of r across e."""
    share = dot(r, e) / dot(e, e)
    return r[0] - share * e[0], r[1] - share * e[1], r[2] - share * e[2]


@part
def free_directions(points, is_edges, g):
    """The tangents along which the closest points can move, two at most: of each whether it is there, t and c [1/m].

    c has the four weights of the pair's vertices; the tangents are orthonormal.
    """
    i, j, k, m = _free_edges(is_edges, g)
    one, t, c = i >= 0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0)
    other, u, d = k >= 0, t, c
    if one:
        t, c = minus(points[i], points[j]), _difference(i, j)
        t, c = _scaled(1.0 / np.sqrt(dot(t, t)), t, c)
    if other:
        u, d = minus(points[k], points[m]), _difference(k, m)
        length, along = dot(u, u), dot(t, u)
        u = minus(u, (along * t[0], along * t[1], along * t[2]))
        d = d[0] - along * c[0], d[1] - along * c[1], d[2] - along * c[2], d[3] - along * c[3]
        left = dot(u, u)
        other = left > FLAT * length
        u, d = _scaled(1.0 / np.sqrt(left), u, d)
    return (one, t, c), (other, u, d)


@part
def _difference(i, j):
    """The weights of x_i - x_j."""
    return (
        1.0 * ((i == 0) - (j == 0)),
        1.0 * ((i == 1) - (j == 1)),
        1.0 * ((i == 2) - (j == 2)),
        1.0 * ((i == 3) - (j == 3)),
    )


@part
def _scaled(by, t, c):
    return (by * t[0], by * t[1], by * t[2]), (by * c[0], by * c[1], by * c[2], by * c[3])


@part
def _free_edges(is_edges, g):
    """The pairs of vertices between which the closest points can move, two at most, -1 for none.

    The corners of the triangle that have a weight, in order: from the first to each of the others.
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
