"""Pair loops of the barrier: which pairs are near, their energy and gradient.

E = sum w m(c) b(q). With s = q - o^2, S = (o + d_hat)^2 - o^2, o the offset:
    b = -(s - S)^2 ln(s / S) d_hat / S^2 [m]    (Li et al. 2020, IPC, eq. 6, in squares; scale: Li et al. 2023)
m(c) = (2 - c/e) c/e for c < e, else 1, the mollifier of nearly parallel edges u, v (IPC, eq. 24), c = |u x v|^2.
"""

import numpy as np

from clothsim.contact.closest_points import cross, dot, minus
from clothsim.contact.distance import closest_points, squared_distance
from clothsim.indexing import four_points
from clothsim.jit import kernel, natural, part

LINE, VALUE, FIRST, SECOND, SHARE, POSE = 4, 7, 8, 9, 10, 11
"""Where in a pose its parts begin, and how long it is."""


@part
def apart(points, is_edges, limit):
    """True where the boxes of the two parts of a pair are further apart than `limit` along an axis."""
    p, a, b, c = points
    return (
        _apart_along(p[0], a[0], b[0], c[0], is_edges, limit)
        | _apart_along(p[1], a[1], b[1], c[1], is_edges, limit)
        | _apart_along(p[2], a[2], b[2], c[2], is_edges, limit)
    )


@part
def _apart_along(p, a, b, c, is_edges, limit):
    low, high = (min(p, a), max(p, a)) if is_edges else (p, p)
    other_low, other_high = min(b, c), max(b, c)
    if not is_edges:
        other_low, other_high = min(other_low, a), max(other_high, a)
    return (low - other_high > limit) | (other_low - high > limit)


@kernel
def near_pairs(x, elements, n_points, limit):
    """The numbers of the pairs with distance below `limit`, and their squared distances. The first n_points pairs are
    point-triangle, the others edge-edge."""
    squared = np.empty(len(elements))
    count = 0
    for e in range(len(elements)):
        points, is_edges = four_points(x, elements, e), e >= n_points
        squared[e] = np.inf
        if not apart(points, is_edges, limit):
            squared[e] = squared_distance(points, is_edges)
        count += squared[e] < limit * limit
    found, distances_squared = np.empty(count, np.int64), np.empty(count)
    k = 0
    for e in range(len(elements)):
        if squared[e] < limit * limit:
            found[k], distances_squared[k] = e, squared[e]
            k += 1
    return found, distances_squared


@part
def barrier(s, S, d_hat):
    """b [m], db/ds < 0 [1/m] and d2b/ds2 > 0 [1/m3] at squared distance s [m2]; 0 from S on."""
    if s >= S:
        return 0.0, 0.0, 0.0
    y = s / S
    log = np.log(y)
    b = np.inf if s <= 0.0 else -d_hat * (y - 1.0) ** 2 * log
    first = -(2.0 * (y - 1.0) * log + (y - 1.0) ** 2 / y)
    second = -(2.0 * log + 4.0 * (y - 1.0) / y - (y - 1.0) ** 2 / (y * y))
    return b, d_hat * first / S, d_hat * second / (S * S)


@part
def edges(points):
    """Both edges of an edge-edge pair [m]."""
    return minus(points[1], points[0]), minus(points[3], points[2])


@part
def crossing(points):
    """c = |u x v|^2 of the edges u, v of an edge-edge pair [m4]."""
    n = cross(*edges(points))
    return dot(n, n)


@part
def crossing_gradient(u, v):
    """dc/du = 2 (|v|^2 u - (u.v) v) and dc/dv alike [m3]."""
    uu, vv, uv = 2.0 * dot(u, u), 2.0 * dot(v, v), 2.0 * dot(u, v)
    du = vv * u[0] - uv * v[0], vv * u[1] - uv * v[1], vv * u[2] - uv * v[2]
    return du, (uu * v[0] - uv * u[0], uu * v[1] - uv * u[1], uu * v[2] - uv * u[2])


@part
def mollifier(share, e):
    """m, dm/dc, d2m/dc2 where c is this share of e, at most 1."""
    return (2.0 - share) * share, 2.0 * (1.0 - share) / e, -2.0 / (e * e)


@kernel
def measure(poses, x, elements, weights, thresholds, n_points, offset, d_hat):
    """The sum of w m b [m3], for kappa = 1, and in `poses (p, POSE)` what all derivatives follow from.

    A pose: the weights g of the closest points, their difference r [m] from LINE on, w b, w b', w b'', and c/e where
    edges are mollified, else 1.
    """
    S = d_hat * (2.0 * offset + d_hat)
    total = 0.0
    for e in range(len(elements)):
        points = four_points(x, elements, e)
        g, r = closest_points(points, e >= n_points)
        b, first, second = barrier(dot(r, r) - offset * offset, S, d_hat)
        w = weights[e]
        for i in range(4):
            poses[e, i] = g[i]
        for k in range(3):
            poses[e, LINE + k] = r[k]
        poses[e, VALUE], poses[e, FIRST], poses[e, SECOND], poses[e, SHARE] = w * b, w * first, w * second, 1.0
        if thresholds[e] > 0.0:
            share = min(crossing(points) / thresholds[e], 1.0)
            poses[e, SHARE] = share
            m = mollifier(share, thresholds[e])[0]
            b = b * m if m > 0.0 else 0.0
        total += w * b
    return total


@kernel
def gradient(poses, x, elements, thresholds):
    """d/dx of the sum of w m b, (N, 3) [m2]: w (2 m b' g_i r + b dm/dc dc/dx_i)."""
    out = np.zeros_like(x)
    for e in range(len(elements)):
        m = 1.0
        if poses[e, SHARE] < 1.0:
            m, dm, _ = mollifier(poses[e, SHARE], thresholds[e])
            du, dv = crossing_gradient(*edges(four_points(x, elements, e)))
            turning = poses[e, VALUE] * dm
            for k in range(3):
                out[elements[e, 0], k] -= turning * du[k]
                out[elements[e, 1], k] += turning * du[k]
                out[elements[e, 2], k] -= turning * dv[k]
                out[elements[e, 3], k] += turning * dv[k]
        slope = 2.0 * m * poses[e, FIRST]
        for i in range(4):
            row = natural(elements[e, i])
            for k in range(3):
                out[row, k] += slope * poses[e, i] * poses[e, LINE + k]
    return out


@kernel
def pull(x, elements, weights, thresholds, n_points, offset, d_hat, least):
    """Of each pair g (p, 4), r (p, 3) [m] and w m db/dd (p,) [m2], the force along r for kappa = 1.

    least [m]: a gap that is smaller counts as this one.
    """
    S = d_hat * (2.0 * offset + d_hat)
    g, r, slopes = np.zeros((len(elements), 4)), np.zeros((len(elements), 3)), np.zeros(len(elements))
    for e in range(len(elements)):
        points = four_points(x, elements, e)
        weights_of, line = closest_points(points, e >= n_points)
        g[e, 0], g[e, 1], g[e, 2], g[e, 3] = weights_of
        r[e, 0], r[e, 1], r[e, 2] = line
        distance = max(np.sqrt(dot(line, line)), offset + least)
        s = distance * distance - offset * offset
        if s < S:
            m = 1.0
            if thresholds[e] > 0.0:
                m = mollifier(min(crossing(points) / thresholds[e], 1.0), thresholds[e])[0]
            slopes[e] = weights[e] * m * barrier(s, S, d_hat)[1] * 2.0 * distance
    return g, r, slopes
