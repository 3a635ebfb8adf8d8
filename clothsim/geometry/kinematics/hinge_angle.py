"""Hinge angle, its gradient and its exact Hessian, for numba kernels.

The hinge a, b, c, d: edge a -> b, c opposite it in the first triangle, d in the second. With
e = b - a, r = c - a, s = d - a and the normals n1 = e x r, n2 = s x e (not of unit length)

    theta = atan2(-|e| n1.s, n1.n2)      in [-pi, pi], 0 where the triangles are coplanar

with the sign of `mesh.cloth.dihedral_angles`: positive where the cloth folds towards its back. atan2 is as exact near
0 and near pi as anywhere. Gradient: Bridson et al. 2003, section 4.2; Hessian: the derivative of that gradient, as in
Tamstorf & Grinspun 2013. Points are tuples of three floats: nothing is allocated.

A hinge with a triangle that has no area to round-off (sine of the angle at its corner a below 1e-14) has no angle:
the direction is flagged as invalid, its gradient and Hessian are zero. Nothing is ever NaN for finite points.
"""

import numpy as np

from clothsim.base.jit import inlined, part
from clothsim.base.vectors import cross, dot, minus, plus, times

Point = tuple[float, float, float]
Points = tuple[Point, Point, Point, Point]
Rows = tuple[Point, Point, Point]

_NO_AREA = 1e-28
"""Squared sine below which a triangle counts as a line."""


@part
def hinge_direction(a: Point, b: Point, c: Point, d: Point) -> tuple[float, float, bool]:
    """Both arguments of arctan2 for theta [rad], and whether the angle is defined."""
    e, r, s = minus(b, a), minus(c, a), minus(d, a)
    n1, n2 = cross(e, r), cross(s, e)
    return -np.sqrt(dot(e, e)) * dot(n1, s), dot(n1, n2), _area(e, r, n1) & _area(e, s, n2)


@part
def hinge_angle_gradient(a: Point, b: Point, c: Point, d: Point) -> Points:
    """d theta / d (a, b, c, d), four vectors [1/m].

    A displacement of a corner changes the angle by its height over the edge, 1/|h| = |e|/|n|; the edge balances force
    and torque: g_c = -|e| n1/|n1|^2,  g_d = -|e| n2/|n2|^2,  g_b = -(u g_c + w g_d),  g_a = -((1-u) g_c + (1-w) g_d),
    where u = r.e/|e|^2 and w = s.e/|e|^2 are the coordinates of c and d along the edge.
    """
    e, r, s = minus(b, a), minus(c, a), minus(d, a)
    n1, n2 = cross(e, r), cross(s, e)
    if not (_area(e, r, n1) & _area(e, s, n2)):
        zero = (0.0, 0.0, 0.0)
        return zero, zero, zero, zero
    ee = dot(e, e)
    g_c = times(-np.sqrt(ee) / dot(n1, n1), n1)
    g_d = times(-np.sqrt(ee) / dot(n2, n2), n2)
    u, w = dot(r, e) / ee, dot(s, e) / ee
    g_b = plus(times(-u, g_c), times(-w, g_d))
    g_a = plus(times(u - 1, g_c), times(w - 1, g_d))
    return g_a, g_b, g_c, g_d


@inlined
def hinge_blocks(a: Point, b: Point, c: Point, d: Point, first: float, second: float) -> tuple[Rows, ...]:
    """first d2theta + second g g', g = d theta/d (a, b, c, d): the blocks aa, ab, ac, ad, bb, bc, bd, cc, cd, dd.

    Zeros for a hinge without an angle. In the frame of a triangle, t along the edge of length l, m from the edge to the
    corner at height h, n the normal, a displacement of corner p changes the angle by g_p = -f_p n, f_c = 1/h, f_b =
    -u/h, f_a = (u - 1)/h; it turns n by -y_p n' with y_p = f_p m + k_p t, k_b = -k_a = 1/l, k_c = 0. With n m' summed
    over both triangles, which is symmetric,

        pq = sum over both (f_q n y_p' + f_p y_q n') + k_p k_q sum over both (n m')

    and cd = 0. Each block is three rows.
    """
    valid, ee, t, (n1, a1, b1, c1), (n2, a2, b2, d2) = _frames(a, b, c, d)
    first, second = first if valid else 0.0, second if valid else 0.0
    m1, m2, along = cross(n1, t), cross(t, n2), times(1 / np.sqrt(ee), t)
    y_a1, y_b1, y_c1 = minus(times(a1, m1), along), plus(times(b1, m1), along), times(c1, m1)
    y_a2, y_b2, y_d2 = minus(times(a2, m2), along), plus(times(b2, m2), along), times(d2, m2)
    g_a, g_b, g_c, g_d = _gradients(n1, a1, b1, c1, n2, a2, b2, d2)
    turn = _add_outer(0.5 * first / ee, m1, n1, _outer(0.5 * first / ee, n1, m1))
    turn = _add_outer(0.5 * first / ee, m2, n2, _add_outer(0.5 * first / ee, n2, m2, turn))
    n1, n2 = times(first, n1), times(first, n2)
    aa = _bent(a1, y_a1, a1, y_a1, n1, _bent(a2, y_a2, a2, y_a2, n2, _outer(second, g_a, g_a)))
    ab = _bent(a1, y_a1, b1, y_b1, n1, _bent(a2, y_a2, b2, y_b2, n2, _outer(second, g_a, g_b)))
    bb = _bent(b1, y_b1, b1, y_b1, n1, _bent(b2, y_b2, b2, y_b2, n2, _outer(second, g_b, g_b)))
    return (
        _sum(aa, turn, 1.0),
        _sum(ab, turn, -1.0),
        _bent(a1, y_a1, c1, y_c1, n1, _outer(second, g_a, g_c)),
        _bent(a2, y_a2, d2, y_d2, n2, _outer(second, g_a, g_d)),
        _sum(bb, turn, 1.0),
        _bent(b1, y_b1, c1, y_c1, n1, _outer(second, g_b, g_c)),
        _bent(b2, y_b2, d2, y_d2, n2, _outer(second, g_b, g_d)),
        _bent(c1, y_c1, c1, y_c1, n1, _outer(second, g_c, g_c)),
        _outer(second, g_c, g_d),
        _bent(d2, y_d2, d2, y_d2, n2, _outer(second, g_d, g_d)),
    )


@inlined
def hinge_squares(a: Point, b: Point, c: Point, d: Point, factor: float) -> tuple[Rows, ...]:
    """factor g g': `hinge_blocks` without the second derivative, a sixth of its operations."""
    valid, _, _, (n1, a1, b1, c1), (n2, a2, b2, d2) = _frames(a, b, c, d)
    factor = factor if valid else 0.0
    g_a, g_b, g_c, g_d = _gradients(n1, a1, b1, c1, n2, a2, b2, d2)
    return (
        _outer(factor, g_a, g_a),
        _outer(factor, g_a, g_b),
        _outer(factor, g_a, g_c),
        _outer(factor, g_a, g_d),
        _outer(factor, g_b, g_b),
        _outer(factor, g_b, g_c),
        _outer(factor, g_b, g_d),
        _outer(factor, g_c, g_c),
        _outer(factor, g_c, g_d),
        _outer(factor, g_d, g_d),
    )


@inlined
def _frames(a, b, c, d):
    """Whether the hinge has an angle, |e|^2, t; and n, f_a, f_b, f_c or f_d of each triangle.

    Any regular hinge stands in for an invalid one: its blocks are multiplied by 0.
    """
    e, r, s = minus(b, a), minus(c, a), minus(d, a)
    valid = _area(e, r, cross(e, r)) & _area(e, s, cross(s, e))
    e, r, s = _select(valid, e, 1.0, 0.0), _select(valid, r, 0.0, 1.0), _select(valid, s, 0.0, -1.0)
    n1, n2 = cross(e, r), cross(s, e)
    ee = dot(e, e)
    length, size1, size2 = np.sqrt(ee), np.sqrt(dot(n1, n1)), np.sqrt(dot(n2, n2))
    t, n1, n2 = times(1 / length, e), times(1 / size1, n1), times(1 / size2, n2)
    c1, d2 = length / size1, length / size2
    b1, b2 = -dot(r, e) / ee * c1, -dot(s, e) / ee * d2
    return valid, ee, t, (n1, -b1 - c1, b1, c1), (n2, -b2 - d2, b2, d2)


@part
def _gradients(n1: Point, a1: float, b1: float, c1: float, n2: Point, a2: float, b2: float, d2: float) -> Points:
    """g_a, g_b, g_c, g_d from the frames."""
    g_a, g_b = minus(times(-a1, n1), times(a2, n2)), minus(times(-b1, n1), times(b2, n2))
    return g_a, g_b, times(-c1, n1), times(-d2, n2)


@part
def _select(valid: bool, a: Point, x: float, y: float) -> Point:
    """a, or (x, y, 0) where the hinge has no angle."""
    return a[0] if valid else x, a[1] if valid else y, a[2] if valid else 0.0


@part
def _bent(f_p: float, y_p: Point, f_q: float, y_q: Point, n: Point, rows: Rows) -> Rows:
    """rows + f_q n y_p' + f_p y_q n'."""
    return _add_outer(f_p, y_q, n, _add_outer(f_q, n, y_p, rows))


@part
def _outer(factor: float, a: Point, b: Point) -> Rows:
    """factor a b', three rows."""
    return times(factor * a[0], b), times(factor * a[1], b), times(factor * a[2], b)


@part
def _add_outer(factor: float, a: Point, b: Point, rows: Rows) -> Rows:
    """rows + factor a b'."""
    return _sum(rows, _outer(factor, a, b), 1.0)


@part
def _sum(rows: Rows, others: Rows, factor: float) -> Rows:
    """rows + factor others."""
    return (
        plus(rows[0], times(factor, others[0])),
        plus(rows[1], times(factor, others[1])),
        plus(rows[2], times(factor, others[2])),
    )


@part
def _area(edge1: Point, edge2: Point, normal: Point) -> bool:
    """True where a triangle has an area above round-off."""
    return dot(normal, normal) > _NO_AREA * dot(edge1, edge1) * dot(edge2, edge2)
