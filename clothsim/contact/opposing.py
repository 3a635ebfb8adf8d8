"""Opposing body surfaces about a cloth vertex: closest triangles, and hits of lines along their normals."""

import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.contact.closest_points import cross, dot, minus, point_triangle_closest
from clothsim.jit import kernel, part

OUTSIDE, NONE, INSIDE = -1, 0, 1


@kernel
def closest_on_triangles(x: Floats, points: Ints, triangles: Ints) -> tuple[Floats, Floats]:
    """Weights (p, 3) of the corners at the point of each triangle (p, 3) closest to a row of x, and distances [m]."""
    weights, distances = np.empty((len(points), 3)), np.empty(len(points))
    for k in range(len(points)):
        i, a, b, c = points[k], triangles[k, 0], triangles[k, 1], triangles[k, 2]
        u, v, w = point_triangle_closest(
            (x[i, 0], x[i, 1], x[i, 2]),
            (x[a, 0], x[a, 1], x[a, 2]),
            (x[b, 0], x[b, 1], x[b, 2]),
            (x[c, 0], x[c, 1], x[c, 2]),
        )
        weights[k, 0], weights[k, 1], weights[k, 2] = u, v, w
        squared = 0.0
        for m in range(3):
            squared += (x[i, m] - u * x[a, m] - v * x[b, m] - w * x[c, m]) ** 2
        distances[k] = np.sqrt(squared)
    return weights, distances


@kernel
def line_hits(x: Floats, origins: Floats, directions: Floats, triangles: Ints) -> tuple[Floats, Floats]:
    """Where the lines meet triangles (p, 3): t (p,) [m] of o + t d, nan where they miss, and the corners' weights."""
    hits, weights = np.full(len(origins), np.nan), np.zeros((len(origins), 3))
    for k in range(len(origins)):
        o = (origins[k, 0], origins[k, 1], origins[k, 2])
        d = (directions[k, 0], directions[k, 1], directions[k, 2])
        t, v, w, facing = _hit(x, o, d, triangles[k, 0], triangles[k, 1], triangles[k, 2])
        if facing != 0.0:
            hits[k], weights[k, 0], weights[k, 1], weights[k, 2] = t, 1.0 - v - w, v, w
    return hits, weights


@kernel
def sides(x: Floats, origins: Floats, directions: Floats, triangles: Ints, least: float) -> Ints:
    """Side of closed surfaces on which the origins are, by the first hit beyond `least` [m] of the ray o + t d.

    INSIDE where it leaves a surface, OUTSIDE where it enters one, NONE where it meets none.
    """
    found = np.zeros(len(origins), np.int64)
    for k in range(len(origins)):
        o = (origins[k, 0], origins[k, 1], origins[k, 2])
        d = (directions[k, 0], directions[k, 1], directions[k, 2])
        nearest = np.inf
        for f in range(len(triangles)):
            t, _, _, facing = _hit(x, o, d, triangles[f, 0], triangles[f, 1], triangles[f, 2])
            if facing != 0.0 and least < t < nearest:
                nearest = t
                found[k] = INSIDE if facing > 0.0 else OUTSIDE
    return found


@part
def _hit(x, o, d, i, j, k):
    """t, the weights of j and k, and d . n where the line o + t d meets a triangle; d . n = 0 where it misses."""
    a = (x[i, 0], x[i, 1], x[i, 2])
    e, f = minus((x[j, 0], x[j, 1], x[j, 2]), a), minus((x[k, 0], x[k, 1], x[k, 2]), a)
    n = cross(e, f)
    facing = dot(d, n)
    if abs(facing) <= 1e-12 * np.sqrt(dot(n, n)):
        return 0.0, 0.0, 0.0, 0.0
    r = minus(a, o)
    t = dot(r, n) / facing
    q = cross(d, r)
    v, w = -dot(f, q) / facing, dot(e, q) / facing
    if min(v, w, 1.0 - v - w) < -1e-9:
        return 0.0, 0.0, 0.0, 0.0
    return t, v, w, facing
