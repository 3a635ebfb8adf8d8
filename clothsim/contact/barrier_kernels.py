"""Pair loops of the barrier: which pairs are near, their energy, gradient and Hessian blocks.

E = sum w m(c) b(q). With s = q - o^2, S = (o + d_hat)^2 - o^2, o the offset:
    b = -(s - S)^2 ln(s / S) d_hat / S^2 [m]    (Li et al. 2020, IPC, eq. 6, in squares; scale: Li et al. 2023)
m(c) = (2 - c/e) c/e for c < e, else 1, the mollifier of nearly parallel edges u, v (IPC, eq. 24), c = |u x v|^2.
"""

import numpy as np

from clothsim.compiled import kernel, part
from clothsim.contact.closest import cross, dot
from clothsim.contact.distance import closest, edge, free_directions


@part
def _apart(x, rows, split, limit):
    """True where the boxes of the two parts of a pair are further apart than `limit` along an axis."""
    for k in range(3):
        low, high = x[rows[0], k], x[rows[0], k]
        if split == 2:
            low, high = min(low, x[rows[1], k]), max(high, x[rows[1], k])
        other_low, other_high = x[rows[2], k], x[rows[2], k]
        other_low, other_high = min(other_low, x[rows[3], k]), max(other_high, x[rows[3], k])
        if split == 1:
            other_low, other_high = min(other_low, x[rows[1], k]), max(other_high, x[rows[1], k])
        if low - other_high > limit or other_low - high > limit:
            return True
    return False


@kernel
def near_pairs(x, elements, n_points, limit):
    """The numbers of the pairs with distance below `limit`, and their squared distances. The first n_points pairs are
    point-triangle, the others edge-edge."""
    g, r = np.empty(4), np.empty(3)
    squared = np.empty(len(elements))
    count = 0
    for e in range(len(elements)):
        split = 1 if e < n_points else 2
        squared[e] = np.inf
        if not _apart(x, elements[e], split, limit):
            squared[e] = closest(x, elements[e], split == 2, g, r)
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
    """b [m] at squared distance s [m2]."""
    if s >= S:
        return 0.0
    return np.inf if s <= 0.0 else -d_hat * (s / S - 1.0) ** 2 * np.log(s / S)


@part
def barrier_slopes(s, S, d_hat):
    """db/ds < 0 [1/m] and d2b/ds2 > 0 [1/m3]."""
    y = s / S
    first = -(2.0 * (y - 1.0) * np.log(y) + (y - 1.0) ** 2 / y)
    second = -(2.0 * np.log(y) + 4.0 * (y - 1.0) / y - (y - 1.0) ** 2 / (y * y))
    return d_hat * first / S, d_hat * second / (S * S)


@part
def crossing(x, rows):
    """c = |u x v|^2 of the edges u, v of an edge-edge pair [m4]."""
    n = cross(edge(x, rows[0], rows[1]), edge(x, rows[2], rows[3]))
    return dot(n, n)


@part
def mollifier(c, e):
    """m, dm/dc, d2m/dc2."""
    if c >= e:
        return 1.0, 0.0, 0.0
    return (2.0 - c / e) * c / e, 2.0 * (1.0 - c / e) / e, -2.0 / (e * e)


@kernel
def value(x, elements, weights, thresholds, n_points, offset, d_hat):
    """Sum of w m b [m3], for kappa = 1."""
    S = d_hat * (2.0 * offset + d_hat)
    g, r = np.empty(4), np.empty(3)
    total = 0.0
    for e in range(len(elements)):
        b = barrier(closest(x, elements[e], e >= n_points, g, r) - offset * offset, S, d_hat)
        if b > 0.0 and thresholds[e] > 0.0:
            m = mollifier(crossing(x, elements[e]), thresholds[e])[0]
            b = b * m if m > 0.0 else 0.0
        total += weights[e] * b
    return total


@kernel
def gradient(x, elements, weights, thresholds, n_points, offset, d_hat):
    """d/dx of the value, (N, 3) [m2]: w (2 m b' g_i r + b dm/dc dc/dx_i)."""
    S = d_hat * (2.0 * offset + d_hat)
    out = np.zeros_like(x)
    g, r, dc = np.empty(4), np.empty(3), np.empty(12)
    for e in range(len(elements)):
        rows = elements[e]
        s = closest(x, rows, e >= n_points, g, r) - offset * offset
        if s >= S:
            continue
        slope = barrier_slopes(s, S, d_hat)[0]
        m, dm = 1.0, 0.0
        if thresholds[e] > 0.0:
            m, dm, _ = mollifier(crossing(x, rows), thresholds[e])
        for i in range(4):
            for k in range(3):
                out[rows[i], k] += weights[e] * 2.0 * m * slope * g[i] * r[k]
        if dm > 0.0:
            b = barrier(s, S, d_hat)
            _crossing_gradient(x, rows, dc)
            for i in range(4):
                for k in range(3):
                    out[rows[i], k] += weights[e] * b * dm * dc[3 * i + k]
    return out


@kernel
def pull(x, elements, weights, thresholds, n_points, offset, d_hat, least):
    """Of each pair g (p, 4), r (p, 3) [m] and w m db/dd (p,) [m2], the force along r for kappa = 1.

    least [m]: a gap that is smaller counts as this one.
    """
    S = d_hat * (2.0 * offset + d_hat)
    g, r, slopes = np.zeros((len(elements), 4)), np.zeros((len(elements), 3)), np.zeros(len(elements))
    for e in range(len(elements)):
        squared = closest(x, elements[e], e >= n_points, g[e], r[e])
        distance = max(np.sqrt(squared), offset + least)
        s = distance * distance - offset * offset
        if s < S:
            m = mollifier(crossing(x, elements[e]), thresholds[e])[0] if thresholds[e] > 0.0 else 1.0
            slopes[e] = weights[e] * m * barrier_slopes(s, S, d_hat)[0] * 2.0 * distance
    return g, r, slopes


@kernel
def hessian(blocks, x, elements, weights, thresholds, n_points, offset, d_hat, project):
    """Fills `blocks (p, 12, 12)` of d2/dx2 of the value; says which of them are still to be projected, (p,).

    Without a mollifier a block is 4 b'' q gg'nn' + b' (2 gg'I - 2 sum G G'). Its part along gg'nn' is clamped at 0;
    each tangent a leaves 2|b'| (G G' - gg't t'), which in the directions g t and c n is |r||g||c| off the diagonal and
    |r|^2 |c|^2 on it: its positive eigenpair is in closed form. Tangents along which the closest point does not move
    have -2|b'| gg't t' alone: none of it is kept. Mollified blocks are dense: they are left to `semidefinite.clamp`.
    """
    S = d_hat * (2.0 * offset + d_hat)
    dense = np.zeros(len(elements), np.bool_)
    g, r, t, c, v = np.empty(4), np.empty(3), np.zeros((2, 3)), np.zeros((2, 4)), np.empty((3, 12))
    for e in range(len(elements)):
        rows = elements[e]
        s = closest(x, rows, e >= n_points, g, r) - offset * offset
        free = free_directions(x, rows, e >= n_points, g, t, c)
        first, second = barrier_slopes(s, S, d_hat)
        m, dm, d2m = 1.0, 0.0, 0.0
        if thresholds[e] > 0.0:
            m, dm, d2m = mollifier(crossing(x, rows), thresholds[e])
        w = weights[e] if s < S else 0.0
        whole = dm > 0.0 or not project
        if whole:
            _exact_sides(v, g, r, t, c, free, w * m * first, w * m * second)
        else:
            _projected_sides(v, g, r, t, c, free, w * first, w * second)
        _squares(blocks[e], v, 2.0 * w * m * first if whole else 0.0, g)
        if dm > 0.0:
            _mollify(blocks[e], v, x, rows, g, r, w * barrier(s, S, d_hat), w * first, dm, d2m)
            dense[e] = project
    return dense


@part
def _exact_sides(v, g, r, t, c, free, first, second):
    """The rows of v (3, 12), whose squares are 4 b'' gg'rr' - 2 b' sum G G', for b' < 0 < b''."""
    along, across = np.sqrt(4.0 * second), np.sqrt(-2.0 * first)
    for a in range(2):
        turning = across if a < free else 0.0
        for i in range(4):
            for p in range(3):
                v[0, 3 * i + p] = along * g[i] * r[p]
                v[1 + a, 3 * i + p] = turning * (g[i] * t[a, p] + c[a, i] * r[p])


@part
def _projected_sides(v, g, r, t, c, free, first, second):
    """The rows of v (3, 12), whose squares are what is positive."""
    squared = r[0] * r[0] + r[1] * r[1] + r[2] * r[2]
    length = np.sqrt(squared)
    size = np.sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2] + g[3] * g[3])
    normal = np.sqrt(max(4.0 * second * squared + 2.0 * first, 0.0)) / length
    for a in range(2):
        tangential = along = 0.0
        if a < free:
            reach = np.sqrt(c[a, 0] ** 2 + c[a, 1] ** 2 + c[a, 2] ** 2 + c[a, 3] ** 2)
            off, on = length * size * reach, squared * reach * reach
            eigenvalue = 0.5 * (on + np.sqrt(on * on + 4.0 * off * off))
            share = np.sqrt(-2.0 * first * eigenvalue / (off * off + eigenvalue * eigenvalue))
            tangential, along = share * off / size, share * eigenvalue / (reach * length)
        for i in range(4):
            for p in range(3):
                v[0, 3 * i + p] = normal * g[i] * r[p]
                v[1 + a, 3 * i + p] = tangential * g[i] * t[a, p] + along * c[a, i] * r[p]


@part
def _squares(block, v, all_ways, g):
    """block = the sum of v v' over the rows of v (3, 12), and all_ways gg'I."""
    for i in range(12):
        a, b, c = v[0, i], v[1, i], v[2, i]
        for j in range(12):
            block[i, j] = a * v[0, j] + b * v[1, j] + c * v[2, j]
        for j in range(4):
            block[i, 3 * j + i % 3] += all_ways * g[i // 3] * g[j]


@part
def _crossing_gradient(x, rows, out):
    """dc/dx_i, (12,): dc/du = 2 (|v|^2 u - (u.v) v) at the ends of u, dc/dv alike."""
    u, v = edge(x, rows[0], rows[1]), edge(x, rows[2], rows[3])
    uu, vv, uv = dot(u, u), dot(v, v), dot(u, v)
    for k in range(3):
        du, dv = 2.0 * (vv * u[k] - uv * v[k]), 2.0 * (uu * v[k] - uv * u[k])
        out[k], out[3 + k], out[6 + k], out[9 + k] = -du, du, -dv, dv


@part
def _mollify(block, sides, x, rows, g, r, b, first, dm, d2m):
    """Adds b' (dm dq' + dq dm') + b (m'' dc dc' + m' d2c): what the mollifier adds to m times the block.

    sides (3, 12) is used up. d2c/du2 = 2 (|v|^2 I - v v'), d2c/du dv = 2 (2 u v' - v u' - u.v I).
    """
    dc, dq, mixed = sides[0], sides[1], sides[2]
    _crossing_gradient(x, rows, dc)
    for i in range(4):
        for k in range(3):
            dq[3 * i + k] = 2.0 * g[i] * r[k]
    for j in range(12):
        mixed[j] = first * dm * dq[j] + b * d2m * dc[j]
    for i in range(12):
        by_crossing, by_distance = dc[i], first * dm * dq[i]
        for j in range(12):
            block[i, j] += by_crossing * mixed[j] + by_distance * dc[j]
    u, v = edge(x, rows[0], rows[1]), edge(x, rows[2], rows[3])
    uu, vv, uv = dot(u, u), dot(v, v), dot(u, v)
    for p in range(3):
        for q in range(3):
            same = 1.0 if p == q else 0.0
            of_u, of_v = vv * same - v[p] * v[q], uu * same - u[p] * u[q]
            across = 2.0 * u[p] * v[q] - v[p] * u[q] - uv * same
            back = 2.0 * v[p] * u[q] - u[p] * v[q] - uv * same
            for i in range(2):
                for j in range(2):
                    k = 2.0 * b * dm * (1.0 if i == j else -1.0)
                    block[3 * i + p, 3 * j + q] += k * of_u
                    block[6 + 3 * i + p, 6 + 3 * j + q] += k * of_v
                    block[3 * i + p, 6 + 3 * j + q] += k * across
                    block[6 + 3 * i + p, 3 * j + q] += k * back
