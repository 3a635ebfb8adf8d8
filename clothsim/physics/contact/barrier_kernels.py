"""Pair loops of the barrier: active set, energy and gradient.

E = sum w m(c) b(s). With q the squared distance, o the offset, s = q - o^2 and s_hat = (o + d_hat)^2 - o^2:

    b = -(s - s_hat)^2 ln(s / s_hat) d_hat / s_hat^2 [m]

(Li et al. 2020, IPC, eq. 6, in squared distances; scale: Li et al. 2023). m(c) = (2 - c/e) c/e for c < e, else 1, is
the mollifier of nearly parallel edges u, v (IPC, eq. 24), c = |u x v|^2.
"""

import numpy as np

from clothsim.base.jit import kernel, natural, part
from clothsim.base.vectors import cross, dot, four_points, minus
from clothsim.physics.contact.distance import closest_points, distance_squared

DIFFERENCE, VALUE, FIRST, SECOND, CROSS_RATIO, RECORD_SIZE = 4, 7, 8, 9, 10, 11
"""Columns of a closest-point record, and their number."""


@part
def boxes_apart(points, is_edges, limit):
    """True where the boxes of the two elements of a pair are further apart than `limit` along an axis."""
    p, a, b, c = points
    return (
        _intervals_apart(p[0], a[0], b[0], c[0], is_edges, limit)
        | _intervals_apart(p[1], a[1], b[1], c[1], is_edges, limit)
        | _intervals_apart(p[2], a[2], b[2], c[2], is_edges, limit)
    )


@part
def _intervals_apart(p, a, b, c, is_edges, limit):
    """`boxes_apart` along one axis."""
    low, high = (min(p, a), max(p, a)) if is_edges else (p, p)
    other_low, other_high = min(b, c), max(b, c)
    if not is_edges:
        other_low, other_high = min(other_low, a), max(other_high, a)
    return (low - other_high > limit) | (other_low - high > limit)


@kernel
def pairs_within(x, elements, n_points, limit):
    """Indices of the pairs with distance below `limit`, and their squared distances [m2].

    The first n_points pairs are point-triangle, the others edge-edge.
    """
    all_squared = np.empty(len(elements))
    count = 0
    for e in range(len(elements)):
        points, is_edges = four_points(x, elements, e), e >= n_points
        all_squared[e] = np.inf
        if not boxes_apart(points, is_edges, limit):
            all_squared[e] = distance_squared(points, is_edges)
        count += all_squared[e] < limit * limit
    found, distances_squared = np.empty(count, np.int64), np.empty(count)
    k = 0
    for e in range(len(elements)):
        if all_squared[e] < limit * limit:
            found[k], distances_squared[k] = e, all_squared[e]
            k += 1
    return found, distances_squared


@part
def barrier(s, s_hat, d_hat):
    """b [m], db/ds < 0 [1/m] and d2b/ds2 > 0 [1/m3] at s [m2]; 0 from s_hat on."""
    if s >= s_hat:
        return 0.0, 0.0, 0.0
    y = s / s_hat
    log = np.log(y)
    b = np.inf if s <= 0.0 else -d_hat * (y - 1.0) ** 2 * log
    first = -(2.0 * (y - 1.0) * log + (y - 1.0) ** 2 / y)
    second = -(2.0 * log + 4.0 * (y - 1.0) / y - (y - 1.0) ** 2 / (y * y))
    return b, d_hat * first / s_hat, d_hat * second / (s_hat * s_hat)


@part
def edges(points):
    """Both edges of an edge-edge pair [m]."""
    return minus(points[1], points[0]), minus(points[3], points[2])


@part
def cross_squared(points):
    """c = |u x v|^2 of the edges u, v of an edge-edge pair [m4]."""
    n = cross(*edges(points))
    return dot(n, n)


@part
def cross_squared_gradient(u, v):
    """dc/du = 2 (|v|^2 u - (u.v) v) and dc/dv likewise [m3]."""
    uu, vv, uv = 2.0 * dot(u, u), 2.0 * dot(v, v), 2.0 * dot(u, v)
    du = vv * u[0] - uv * v[0], vv * u[1] - uv * v[1], vv * u[2] - uv * v[2]
    return du, (uu * v[0] - uv * u[0], uu * v[1] - uv * u[1], uu * v[2] - uv * u[2])


@part
def mollifier(ratio, e):
    """m, dm/dc, d2m/dc2 at the ratio c/e, at most 1."""
    return (2.0 - ratio) * ratio, 2.0 * (1.0 - ratio) / e, -2.0 / (e * e)


@kernel
def evaluate(records, x, elements, weights, thresholds, n_points, offset, d_hat):
    """Sum of w m b [m3], for kappa = 1; writes the closest-point records that all derivatives follow from.

    A record, a row of `records (p, RECORD_SIZE)`: the weights g of the closest points, from DIFFERENCE on their
    difference r [m], w b, w b', w b'', and c/e where edges are mollified, else 1.
    """
    s_hat = d_hat * (2.0 * offset + d_hat)
    total = 0.0
    for e in range(len(elements)):
        points = four_points(x, elements, e)
        g, r = closest_points(points, e >= n_points)
        b, first, second = barrier(dot(r, r) - offset * offset, s_hat, d_hat)
        w = weights[e]
        for i in range(4):
            records[e, i] = g[i]
        for k in range(3):
            records[e, DIFFERENCE + k] = r[k]
        records[e, VALUE], records[e, FIRST], records[e, SECOND] = w * b, w * first, w * second
        records[e, CROSS_RATIO] = 1.0
        if thresholds[e] > 0.0:
            ratio = min(cross_squared(points) / thresholds[e], 1.0)
            records[e, CROSS_RATIO] = ratio
            m = mollifier(ratio, thresholds[e])[0]
            b = b * m if m > 0.0 else 0.0
        total += w * b
    return total


@kernel
def gradient(records, x, elements, thresholds):
    """d/dx of the sum of w m b, (N, 3) [m2]: w (2 m b' g_i r + b dm/dc dc/dx_i)."""
    out = np.zeros_like(x)
    for e in range(len(elements)):
        m = 1.0
        if records[e, CROSS_RATIO] < 1.0:
            m, dm, _ = mollifier(records[e, CROSS_RATIO], thresholds[e])
            du, dv = cross_squared_gradient(*edges(four_points(x, elements, e)))
            mollifier_slope = records[e, VALUE] * dm
            for k in range(3):
                out[elements[e, 0], k] -= mollifier_slope * du[k]
                out[elements[e, 1], k] += mollifier_slope * du[k]
                out[elements[e, 2], k] -= mollifier_slope * dv[k]
                out[elements[e, 3], k] += mollifier_slope * dv[k]
        slope = 2.0 * m * records[e, FIRST]
        for i in range(4):
            row = natural(elements[e, i])
            for k in range(3):
                out[row, k] += slope * records[e, i] * records[e, DIFFERENCE + k]
    return out


@kernel
def normal_forces(x, elements, weights, thresholds, n_points, offset, d_hat, least_gap):
    """g (p, 4), r (p, 3) [m] and w m db/dd (p,) [m2] of each pair, the force along r for kappa = 1.

    least_gap [m]: a smaller gap is replaced by this one.
    """
    s_hat = d_hat * (2.0 * offset + d_hat)
    g, r, slopes = np.zeros((len(elements), 4)), np.zeros((len(elements), 3)), np.zeros(len(elements))
    for e in range(len(elements)):
        points = four_points(x, elements, e)
        pair_weights, difference = closest_points(points, e >= n_points)
        g[e, 0], g[e, 1], g[e, 2], g[e, 3] = pair_weights
        r[e, 0], r[e, 1], r[e, 2] = difference
        distance = max(np.sqrt(dot(difference, difference)), offset + least_gap)
        s = distance * distance - offset * offset
        if s < s_hat:
            m = 1.0
            if thresholds[e] > 0.0:
                m = mollifier(min(cross_squared(points) / thresholds[e], 1.0), thresholds[e])[0]
            slopes[e] = weights[e] * m * barrier(s, s_hat, d_hat)[1] * 2.0 * distance
    return g, r, slopes
