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
def hinge_angle_hessian(a: Point, b: Point, c: Point, d: Point, hessian: Floats) -> None:
    """d2 theta / d (a, b, c, d)^2 [1/m2], written to `hessian (12, 12)`.

    Only three blocks are differentiated: with respect to its own corner and to b, g_c = -|e| n1/|n1|^2 gives cc and cb
    (g_d alike), g_b = -(u g_c + w g_d) gives bb, and theta does not know c and d together: cd = 0. Blocks with a
    follow from rest under translation, the others from symmetry.
    """
    hessian[:] = 0.0
    e, r, s = _minus(b, a), _minus(c, a), _minus(d, a)
    n1, n2 = _cross(e, r), _cross(s, e)
    if _no_area(e, r, n1) or _no_area(e, s, n2):
        return
    _, _, g_c, g_d = hinge_angle_gradient(a, b, c, d)
    _corner_blocks(hessian, 2, e, r, 1.0)
    _corner_blocks(hessian, 3, e, s, -1.0)
    ee = _dot(e, e)
    u, w = _dot(r, e) / ee, _dot(s, e) / ee
    for i in range(3):
        for j in range(3):
            du = r[j] / ee - 2 * u * e[j] / ee
            dw = s[j] / ee - 2 * w * e[j] / ee
            hessian[3 + i, 3 + j] = -(g_c[i] * du + u * hessian[6 + i, 3 + j] + g_d[i] * dw + w * hessian[9 + i, 3 + j])
    for i in range(3, 6):
        for j in range(6, 12):
            hessian[i, j] = hessian[j, i]
    for i in range(3, 12):
        for j in range(3):
            hessian[i, j] = -(hessian[i, 3 + j] + hessian[i, 6 + j] + hessian[i, 9 + j])
            hessian[j, i] = hessian[i, j]
    for i in range(3):
        for j in range(3):
            hessian[i, j] = -(hessian[3 + i, j] + hessian[6 + i, j] + hessian[9 + i, j])


@part
def _corner_blocks(hessian: Floats, corner: int, e: Point, r: Point, side: float) -> None:
    """The blocks (corner, corner) and (corner, b) of a corner at r from a, whose normal is n = side (e x r).

    g = -|e| n/|n|^2, so dg = -n (e.de)/(|e| |n|^2) - |e|/|n|^2 (I - 2 n n'/|n|^2) dn, with dn = side e x dr for the
    corner and dn = side de x r for b. As column j of dn: side (e x i_j), and side (i_j x r).
    """
    n = _times(side, _cross(e, r))
    nn, length = _dot(n, n), np.sqrt(_dot(e, e))
    for j in range(3):
        axis = (1.0 if j == 0 else 0.0, 1.0 if j == 1 else 0.0, 1.0 if j == 2 else 0.0)
        by_corner = _times(side, _cross(e, axis))
        by_b = _times(side, _cross(axis, r))
        along_corner, along_b = _dot(n, by_corner) / nn, _dot(n, by_b) / nn
        for i in range(3):
            row = 3 * corner + i
            hessian[row, 3 * corner + j] = -length / nn * (by_corner[i] - 2 * along_corner * n[i])
            hessian[row, 3 + j] = -length / nn * (by_b[i] - 2 * along_b * n[i]) - n[i] * e[j] / (length * nn)


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
