"""The distance of a pair by its closest points, and its derivatives.

A pair has four vertices x_i: a point and a triangle, or two edges. Its closest points differ by r = sum_i g_i x_i, so
q = d^2 = |r|^2. Where they lie inside a face or an edge, g depends on up to two free parameters with the directions
D_a = dg/dp_a, and e_a = sum_i D_ai x_i = dr/dp_a is tangent to the surface: r . e_a = 0 at the minimum. Hence
    dq/dx_i     = 2 g_i r
    d2q/dx_i dx_j = 2 g_i g_j I - 2 sum_a G_ai G_aj',  G_ai = g_i t_a + c_ai r,
with e_a made orthonormal to t_a, and D_a with the same numbers to c_a (the Schur complement of the minimisation over p,
as in any envelope theorem). One formula serves point-point, point-edge, point-triangle and edge-edge.
"""

import numpy as np

from clothsim.compiled import part
from clothsim.contact.closest import cross, dot, edge_edge_closest, minus, point_triangle_closest

FLAT = 1e-20
"""Square of the sine of the angle of two directions below which the second adds nothing."""


@part
def closest(x, rows, is_edges, g, r):
    """Fills g (4,) and r (3,) of the pair `rows (4,)`; returns d^2 [m2].

    sum g_i x_i is good to the last digits of x only, and at a small gap points anywhere. So r is taken as the part of
    a difference of vertices along the normal of the features (two edges, a face) or across the one edge.
    """
    p, a, b, c = _point(x, rows[0]), _point(x, rows[1]), _point(x, rows[2]), _point(x, rows[3])
    if is_edges:
        s, t = edge_edge_closest(p, a, b, c)
        g[0], g[1], g[2], g[3] = 1.0 - s, s, t - 1.0, -t
        e, f = minus(a, p), minus(c, b)
        one, other = (a if g[0] == 0.0 else p), (c if g[2] == 0.0 else b)
        between = minus(one, other)
        if g[0] * g[1] != 0.0 and g[2] * g[3] != 0.0:
            between = _along(cross(e, f), between)
        elif g[0] * g[1] != 0.0:
            between = _across(between, e)
        elif g[2] * g[3] != 0.0:
            between = _across(between, f)
    else:
        u, v, w = point_triangle_closest(p, a, b, c)
        g[0], g[1], g[2], g[3] = 1.0, -u, -v, -w
        zeros = (u == 0.0) + (v == 0.0) + (w == 0.0)
        if zeros == 0:
            between = _along(cross(minus(b, a), minus(c, a)), minus(p, a))
        elif zeros == 1:
            first, second = (b if u == 0.0 else a), (b if w == 0.0 else c)
            between = _across(minus(p, first), minus(second, first))
        else:
            between = minus(p, a if u != 0.0 else (b if v != 0.0 else c))
    r[0], r[1], r[2] = between
    return dot(between, between)


@part
def _point(x, row):
    return x[row, 0], x[row, 1], x[row, 2]


@part
def edge(x, first, second):
    """x[second] - x[first]."""
    return minus(_point(x, second), _point(x, first))


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
def free_directions(x, rows, is_edges, g, t, c):
    """Fills t (2, 3) with orthonormal tangents and c (2, 4) with their weights [1/m]; returns how many there are."""
    count = 0
    for a in range(2):
        first, second = _free_pair(is_edges, g, a)
        if first < 0:
            continue
        for i in range(4):
            c[count, i] = 0.0
        c[count, first], c[count, second] = 1.0, -1.0
        length = 0.0
        for k in range(3):
            t[count, k] = x[rows[first], k] - x[rows[second], k]
            length += t[count, k] * t[count, k]
        if count == 1:
            along = t[0, 0] * t[1, 0] + t[0, 1] * t[1, 1] + t[0, 2] * t[1, 2]
            for k in range(3):
                t[1, k] -= along * t[0, k]
            for i in range(4):
                c[1, i] -= along * c[0, i]
        left = t[count, 0] ** 2 + t[count, 1] ** 2 + t[count, 2] ** 2
        if not left > FLAT * length:
            continue
        size = np.sqrt(left)
        for k in range(3):
            t[count, k] /= size
        for i in range(4):
            c[count, i] /= size
        count += 1
    return count


@part
def _free_pair(is_edges, g, a):
    """The two vertices between which parameter a moves the closest point, or -1 where it stands at an end."""
    if is_edges:
        i = 2 * a
        return (i, i + 1) if g[i] != 0.0 and g[i + 1] != 0.0 else (-1, -1)
    # the corners of the triangle with a weight, in order: parameter a moves from the first to number a + 1
    first, found = -1, 0
    for i in range(1, 4):
        if g[i] != 0.0:
            if first < 0:
                first = i
            else:
                if found == a:
                    return first, i
                found += 1
    return -1, -1
