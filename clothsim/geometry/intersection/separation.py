"""Certain separation of two triangles: a separating direction found in doubles with an error bound.

Neighbours in a flat sheet are coplanar but for round-off, where every orient3d would need exact arithmetic. These tests
settle nearly all of them first. A separation found here is proven; anything else goes to the exact test.
"""

import numpy as np

from clothsim.base.jit import part
from clothsim.geometry.intersection.predicates import EPSILON

ROUND_OFF = 8.0 * EPSILON
"""Error of a dot product of a vector with a difference of points, over the sum of its absolute terms; 4 would do."""
UNDERFLOW = 1e-300
"""Bound on the error by underflow."""


@part
def separated(x, s, t):
    """True where triangles s and t (three rows of x each) certainly have no point in common.

    Directions: between the centroids; then, for nearly coplanar triangles, perpendicular to each edge within the plane.
    """
    if _separated_along(x, _minus(_sum(x, t), _sum(x, s)), s, t):
        return True
    for triangle in (s, t):
        a, b, c = triangle
        normal = _cross(_edge(x, a, b), _edge(x, a, c))
        for edge in (_edge(x, a, b), _edge(x, b, c), _edge(x, c, a)):
            across = _cross(normal, edge)
            if _separated_along(x, across, s, t) or _separated_along(x, across, t, s):
                return True
    return False


@part
def separated_beyond_vertex(x, v, s, t):
    """True where triangles (v, s0, s1) and (v, t0, t1) certainly have only v in common.

    Direction: between the two closest of the unit vectors from v, one of each.
    """
    nearest, n = -np.inf, (0.0, 0.0, 0.0)
    for i in s:
        for j in t:
            a, b = _unit(_edge(x, v, i)), _unit(_edge(x, v, j))
            cosine = _dot(a, b)
            if cosine > nearest:
                nearest, n = cosine, _minus(a, b)
    for i in s:
        distance, error = _projected(x, n, i, v)
        if not distance > error:
            return False
    for j in t:
        distance, error = _projected(x, n, j, v)
        if not distance < -error:
            return False
    return True


@part
def opened(x, a, b, c, d):
    """True where triangles abc and abd certainly make more than a right angle: their normals do, c and d opposite."""
    e, u, w = _edge(x, a, b), _edge(x, a, c), _edge(x, a, d)
    lengths = _dot(e, e) * np.sqrt(_dot(u, u)) * np.sqrt(_dot(w, w))
    return _dot(_cross(e, u), _cross(e, w)) < -4.0 * ROUND_OFF * lengths - UNDERFLOW


@part
def _separated_along(x, n, s, t):
    """True where n . s < n . t for all corners, by more than the error."""
    highest, lowest = -np.inf, np.inf
    for i in s:
        distance, error = _projected(x, n, i, s[0])
        highest = max(highest, distance + error)
    for j in t:
        distance, error = _projected(x, n, j, s[0])
        lowest = min(lowest, distance - error)
    return highest < lowest


@part
def _projected(x, n, i, origin):
    """n . (x_i - x_origin) and a bound on its error."""
    p, q, r = n[0] * (x[i, 0] - x[origin, 0]), n[1] * (x[i, 1] - x[origin, 1]), n[2] * (x[i, 2] - x[origin, 2])
    return p + q + r, ROUND_OFF * (abs(p) + abs(q) + abs(r)) + UNDERFLOW


@part
def _edge(x, i, j):
    """x_j - x_i."""
    return x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]


@part
def _sum(x, t):
    a, b, c = t
    return x[a, 0] + x[b, 0] + x[c, 0], x[a, 1] + x[b, 1] + x[c, 1], x[a, 2] + x[b, 2] + x[c, 2]


@part
def _minus(u, v):
    return u[0] - v[0], u[1] - v[1], u[2] - v[2]


@part
def _dot(u, v):
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


@part
def _cross(u, v):
    return u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]


@part
def _unit(u):
    """u / |u|; (0, 0, 0) for zero length, along which nothing is separated."""
    length = np.sqrt(_dot(u, u))
    return (u[0] / length, u[1] / length, u[2] / length) if length > 0.0 else (0.0, 0.0, 0.0)
