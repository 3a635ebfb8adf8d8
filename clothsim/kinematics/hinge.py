"""The angle of a hinge, its gradient and its exact Hessian, for numba kernels.

The hinge a, b, c, d: edge a -> b, c opposite it in the first triangle, d in the second. With
e = b - a, r = c - a, s = d - a and the normals n1 = e x r, n2 = s x e (not of unit length)

    theta = atan2(-|e| n1.s, n1.n2)      in [-pi, pi], 0 where the triangles are coplanar

with the sign of `mesh.hinges.dihedral_angles`: positive where the cloth folds towards its back. atan2 is as exact near
0 and near pi as anywhere. Gradient: Bridson et al. 2003, section 4.2; Hessian: the derivative of that gradient, as in
Tamstorf & Grinspun 2013. Points are tuples of three floats: nothing is allocated.

A hinge with a triangle that has no area to round-off (sine of the angle at its corner a below 1e-14) has no angle:
`hinge_angle` gives +inf, and its gradient and Hessian are zero. Nothing is ever NaN for finite points.
"""

import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.compiled import part

Point = tuple[float, float, float]
Points = tuple[Point, Point, Point, Point]

_NO_AREA = 1e-28
"""Squared sine below which a triangle counts as a line."""


@part
def hinge_point(x: Floats, vertex: int) -> Point:
    """Row `vertex` of x (n, 3) as a tuple."""
    return x[vertex, 0], x[vertex, 1], x[vertex, 2]


@part
def hinge_points(x: Floats, vertices: Ints, h: int) -> Points:
    """The four points of row h of `vertices (h, 4)`."""
    return (
        hinge_point(x, vertices[h, 0]),
        hinge_point(x, vertices[h, 1]),
        hinge_point(x, vertices[h, 2]),
        hinge_point(x, vertices[h, 3]),
    )


@part
def hinge_angle(a: Point, b: Point, c: Point, d: Point) -> float:
    """theta [rad]; +inf where a triangle has no area."""
    e, r, s = _minus(b, a), _minus(c, a), _minus(d, a)
    n1, n2 = _cross(e, r), _cross(s, e)
    if _no_area(e, r, n1) or _no_area(e, s, n2):
        return np.inf
    return np.arctan2(-np.sqrt(_dot(e, e)) * _dot(n1, s), _dot(n1, n2))


@part
def hinge_angle_gradient(a: Point, b: Point, c: Point, d: Point) -> Points:
    """d theta / d (a, b, c, d), four vectors [1/m].

    A corner moves the angle by its height over the edge, 1/|h| = |e|/|n|; the edge balances force and torque:
    g_c = -|e| n1/|n1|^2,  g_d = -|e| n2/|n2|^2,  g_b = -(u g_c + w g_d),  g_a = -((1-u) g_c + (1-w) g_d),
    where u = r.e/|e|^2 and w = s.e/|e|^2 are the places of c and d along the edge.
    """
    e, r, s = _minus(b, a), _minus(c, a), _minus(d, a)
    n1, n2 = _cross(e, r), _cross(s, e)
    if _no_area(e, r, n1) or _no_area(e, s, n2):
        zero = (0.0, 0.0, 0.0)
        return zero, zero, zero, zero
    ee = _dot(e, e)
    g_c = _times(-np.sqrt(ee) / _dot(n1, n1), n1)
    g_d = _times(-np.sqrt(ee) / _dot(n2, n2), n2)
    u, w = _dot(r, e) / ee, _dot(s, e) / ee
    g_b = _plus(_times(-u, g_c), _times(-w, g_d))
    g_a = _plus(_times(u - 1, g_c), _times(w - 1, g_d))
    return g_a, g_b, g_c, g_d


@part
def hinge_hessian(a: Point, b: Point, c: Point, d: Point, first: float, second: float, hessian: Floats) -> None:
    """first d2theta + second g g' with g = d theta/d (a, b, c, d), written to `hessian (12, 12)`.

    In the frame of a triangle, t along the edge of length l, m from the edge to the corner at height h, n the normal,
    g_c = -n/h. A move of c turns n by -m (n.dc)/h and changes h by m.dc; a move of b does so -u times as much, and
    turns n by -t (n.db)/l:

        cc = (n m' + m n')/h^2,   cb = t n'/(h l) - u cc,   bb = -u (cb + n t'/(h l)) - w (db + n t'/(h l)) + n m'/l^2

    with db alike, cd = 0, and n m' summed over both triangles, which is symmetric. Rows and columns of a follow from
    rest under translation. Row i of each block is written as a vector.
    """
    e, r, s = _minus(b, a), _minus(c, a), _minus(d, a)
    n1, n2 = _cross(e, r), _cross(s, e)
    if _no_area(e, r, n1) or _no_area(e, s, n2):
        for i in range(12):
            for j in range(12):
                hessian[i, j] = 0.0
        return
    g_a, g_b, g_c, g_d = hinge_angle_gradient(a, b, c, d)
    ee = _dot(e, e)
    length, size1, size2 = np.sqrt(ee), np.sqrt(_dot(n1, n1)), np.sqrt(_dot(n2, n2))
    t, n1, n2 = _times(1 / length, e), _times(1 / size1, n1), _times(1 / size2, n2)
    u, w, m1, m2 = _dot(r, e) / ee, _dot(s, e) / ee, _cross(n1, t), _cross(t, n2)
    per_height1, per_height2 = length / size1, length / size2
    for i in range(3):
        turn1 = _plus(_times(first * n1[i], m1), _times(first * m1[i], n1))
        turn2 = _plus(_times(first * n2[i], m2), _times(first * m2[i], n2))
        cc, dd = _times(per_height1 * per_height1, turn1), _times(per_height2 * per_height2, turn2)
        along1, along2 = _times(first * n1[i] / size1, t), _times(first * n2[i] / size2, t)
        cb = _minus(_times(first * t[i] / size1, n1), _times(u, cc))
        db = _minus(_times(first * t[i] / size2, n2), _times(w, dd))
        bc, bd = _minus(along1, _times(u, cc)), _minus(along2, _times(w, dd))
        bb = _times(0.5 / ee, _plus(turn1, turn2))
        bb = _minus(bb, _plus(_times(u, _plus(cb, along1)), _times(w, _plus(db, along2))))
        ca, da, ac, ad = _closing(cc, cb), _closing(dd, db), _closing(cc, bc), _closing(dd, bd)
        ab, ba = _closing(bb, _plus(cb, db)), _closing(bb, _plus(bc, bd))
        none = (0.0, 0.0, 0.0)
        gradient = g_a, g_b, g_c, g_d
        _write(hessian, i, (_closing(ab, _plus(ac, ad)), ab, ac, ad), second * g_a[i], gradient)
        _write(hessian, 3 + i, (ba, bb, bc, bd), second * g_b[i], gradient)
        _write(hessian, 6 + i, (ca, cb, cc, none), second * g_c[i], gradient)
        _write(hessian, 9 + i, (da, db, none, dd), second * g_d[i], gradient)


@part
def _closing(a: Point, b: Point) -> Point:
    """What makes the sum of three zero."""
    return -a[0] - b[0], -a[1] - b[1], -a[2] - b[2]


@part
def _write(hessian: Floats, row: int, parts: Points, factor: float, gradient: Points) -> None:
    """parts + factor gradient, four vectors each, as a row of `hessian (12, 12)`."""
    for k in range(4):
        for j in range(3):
            hessian[row, 3 * k + j] = parts[k][j] + factor * gradient[k][j]


@part
def _no_area(edge1: Point, edge2: Point, normal: Point) -> bool:
    return not _dot(normal, normal) > _NO_AREA * _dot(edge1, edge1) * _dot(edge2, edge2)


@part
def _plus(a: Point, b: Point) -> Point:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@part
def _minus(a: Point, b: Point) -> Point:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@part
def _times(factor: float, a: Point) -> Point:
    return factor * a[0], factor * a[1], factor * a[2]


@part
def _dot(a: Point, b: Point) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@part
def _cross(a: Point, b: Point) -> Point:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
