"""Pair loops of the barrier: active set, energy, gradient and Hessian, and what friction lags of them.

E = sum w m(c) b(s). With q the squared distance, o the offset, s = q - o^2 and s_hat = (o + d_hat)^2 - o^2:

    b = -(s - s_hat)^2 ln(s / s_hat) d_hat / s_hat^2 [m]

(Li et al. 2020, IPC, eq. 6, in squared distances; scale: Li et al. 2023). m(c) = (2 - c/e) c/e for c < e, else 1, is
the mollifier of nearly parallel edges u, v (IPC, eq. 24), c = |u x v|^2.
"""

import numpy as np

from clothsim.base.jit import kernel, natural, part
from clothsim.base.vectors import cross, dot, four_points, minus
from clothsim.physics.contact.distance import closest_points, distance_squared, tangent_directions
from clothsim.physics.contact.psd_projection import absolute_block, relative
from clothsim.physics.energies.block_sums import add_dense

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


# Hessian of the barrier from the closest-point records of its pairs (`evaluate`).
#
# Without a mollifier the block of a pair is 4 b'' gg'rr' + 2 b' (gg'I - sum G G'), G = g t + c r (see `distance`), with
# b' < 0 < b''. PSD projection in closed form: along gg'rr' the positive part is kept; each tangent t leaves 2|b'| (G G'
# - gg't t'), which in the directions g t and c r is |r||g||c| off the diagonal and |r|^2 |c|^2 on it: its positive
# eigenpair is known. Tangents along which the closest points do not move have -2|b'| gg't t' alone, which projects to
# 0. So the projection has at most three rank-one factors; that of mollified pairs, and of those with a negative weight
# (`pair_list`), is found by their eigenvalues.


@kernel
def rank_one_factors(factors, first, count, records, x, elements, n_points, kappa):
    """Write the rank-one factors of all pairs without a mollifier to `factors` (s, 12); returns their number.

    Those of pair e are count[e] rows from first[e] on, (p,) each; mollified pairs and negative ones get none.
    """
    at = 0
    for e in range(len(elements)):
        first[e], count[e] = at, 0
        if records[e, CROSS_RATIO] < 1.0 or records[e, FIRST] >= 0.0:
            continue
        g, r = _weights_and_difference(records, e)
        slope, curvature = kappa * records[e, FIRST], kappa * records[e, SECOND]
        (has_first, t, c), (has_second, u, d) = tangent_directions(four_points(x, elements, e), e >= n_points, g)
        _add_normal_factor(factors, at, g, r, slope, curvature)
        at += 1
        if has_first:
            _add_tangent_factor(factors, at, g, r, t, c, slope)
            at += 1
        if has_second:
            _add_tangent_factor(factors, at, g, r, u, d, slope)
            at += 1
        count[e] = at - first[e]
    return at


@part
def _weights_and_difference(records, e):
    """g and r of a pair."""
    g = records[e, 0], records[e, 1], records[e, 2], records[e, 3]
    return g, (records[e, DIFFERENCE], records[e, DIFFERENCE + 1], records[e, DIFFERENCE + 2])


@part
def _add_normal_factor(factors, at, g, r, slope, curvature):
    """Factor along g r, 0 where its coefficient is negative."""
    size = np.sqrt(max(4.0 * curvature + 2.0 * slope / dot(r, r), 0.0))
    for i in range(4):
        for p in range(3):
            factors[at, 3 * i + p] = size * g[i] * r[p]


@part
def _add_tangent_factor(factors, at, g, r, t, c, slope):
    """Positive eigenpair of the matrix with |g| z off the diagonal and z^2 on it, z = |r||c|."""
    size = g[0] * g[0] + g[1] * g[1] + g[2] * g[2] + g[3] * g[3]
    z = np.sqrt(dot(r, r) * (c[0] * c[0] + c[1] * c[1] + c[2] * c[2] + c[3] * c[3]))
    root = np.sqrt(z * z + 4.0 * size)
    scale = np.sqrt(-2.0 * slope / (z * root))
    along_t, along_r = scale * z, 0.5 * scale * (z + root)
    for i in range(4):
        for p in range(3):
            factors[at, 3 * i + p] = along_t * g[i] * t[p] + along_r * c[i] * r[p]


@kernel
def exact_blocks(blocks, records, x, elements, thresholds, n_points, kappa):
    """Write the exact Hessian to `blocks (p, 12, 12)`."""
    block, factors = np.empty((1, 9, 9)), np.empty((5, 9))
    for e in range(len(elements)):
        _relative_block(block, 0, factors, records, four_points(x, elements, e), e, e >= n_points, thresholds[e], kappa)
        absolute_block(block, 0, blocks, e)


@kernel
def add_exact(data, at, records, x, elements, thresholds, n_points, kappa):
    """`LanesHessian.add` of the exact Hessian."""
    block, factors, whole, outside = np.empty((1, 9, 9)), np.empty((5, 9)), np.empty((1, 12, 12)), 0
    for e in range(len(elements)):
        _relative_block(block, 0, factors, records, four_points(x, elements, e), e, e >= n_points, thresholds[e], kappa)
        absolute_block(block, 0, whole, 0)
        outside += add_dense(data, at, e, whole.reshape(-1), 4)
    return outside


@kernel
def relative_blocks(blocks, indices, records, x, elements, thresholds, n_points, kappa):
    """Write the Hessians of the pairs `indices` to `blocks (m, 9, 9)`, in the coordinates of `relative`."""
    factors = np.empty((5, 9))
    for k in range(len(indices)):
        e = indices[k]
        _relative_block(
            blocks, k, factors, records, four_points(x, elements, e), e, e >= n_points, thresholds[e], kappa
        )


@part
def _relative_block(blocks, at, factors, records, points, e, is_edges, threshold, kappa):
    """blocks[at] of pair e: m times the unmollified one, b' m' (dq dc' + dc dq') and b (m'' dc dc' + m' d2c).

    factors (5, 9) is overwritten: g r, G of either tangent, dc, and the vector multiplied by dc.
    """
    g, r = _weights_and_difference(records, e)
    m, dm, d2m = 1.0, 0.0, 0.0
    if records[e, CROSS_RATIO] < 1.0:
        m, dm, d2m = mollifier(records[e, CROSS_RATIO], threshold)
    b, slope, curvature = kappa * records[e, VALUE], kappa * records[e, FIRST], kappa * records[e, SECOND]
    (has_first, t, c), (has_second, u, d) = tangent_directions(points, is_edges, g)
    tangent_scale = -2.0 * m * slope
    _fill_distance_vectors(factors, relative(g), r, t, relative(c), u, relative(d))
    first, second = tangent_scale * has_first, tangent_scale * has_second
    _sum_outer_products(blocks, at, factors, 4.0 * m * curvature, first, second)
    if dm > 0.0:
        _fill_mollifier_vectors(factors, cross_squared_gradient(*edges(points)), 2.0 * slope * dm, b * d2m)
        _add_mollifier_products(blocks, at, factors, 2.0 * slope * dm)
    _add_isotropic(blocks, at, relative(g), -tangent_scale)
    if dm > 0.0:
        _add_cross_squared_hessian(blocks, at, *edges(points), 4.0 * b * dm)


@part
def _fill_distance_vectors(factors, g, r, t, c, u, d):
    """g r and G of both tangents in relative coordinates."""
    for i in range(3):
        for p in range(3):
            factors[0, 3 * i + p] = g[i] * r[p]
            factors[1, 3 * i + p] = g[i] * t[p] + c[i] * r[p]
            factors[2, 3 * i + p] = g[i] * u[p] + d[i] * r[p]


@part
def _fill_mollifier_vectors(factors, gradient, distance_scale, cross_scale):
    """dc, and what it is multiplied by. The edges are sqrt 2 times the first two coordinates."""
    du, dv = gradient
    root = np.sqrt(2.0)
    for p in range(3):
        factors[3, p], factors[3, 3 + p], factors[3, 6 + p] = root * du[p], root * dv[p], 0.0
    for i in range(9):
        factors[4, i] = distance_scale * factors[0, i] + cross_scale * factors[3, i]


@part
def _sum_outer_products(blocks, at, factors, normal_scale, first_scale, second_scale):
    """Sum of the outer products of the vectors of the distance, without the isotropic part."""
    for i in range(9):
        normal = normal_scale * factors[0, i]
        tangent1, tangent2 = first_scale * factors[1, i], second_scale * factors[2, i]
        for j in range(9):
            blocks[at, i, j] = normal * factors[0, j] + tangent1 * factors[1, j] + tangent2 * factors[2, j]


@part
def _add_mollifier_products(blocks, at, factors, distance_scale):
    """Add the outer products with dc."""
    for i in range(9):
        cross, distance = factors[3, i], distance_scale * factors[0, i]
        for j in range(9):
            blocks[at, i, j] = blocks[at, i, j] + cross * factors[4, j] + distance * factors[3, j]


@part
def _add_isotropic(blocks, at, g, size):
    """Add size gg' I."""
    for i in range(3):
        for j in range(3):
            for p in range(3):
                blocks[at, 3 * i + p, 3 * j + p] += size * g[i] * g[j]


@part
def _add_cross_squared_hessian(blocks, at, u, v, size):
    """Add size d2c/2: d2c/du2 = 2 (|v|^2 I - v v'), d2c/du dv = 2 (2 u v' - v u' - u.v I)."""
    uu, vv, uv = dot(u, u), dot(v, v), dot(u, v)
    for p in range(3):
        for q in range(3):
            same = 1.0 if p == q else 0.0
            blocks[at, p, q] += size * (vv * same - v[p] * v[q])
            blocks[at, 3 + p, 3 + q] += size * (uu * same - u[p] * u[q])
            blocks[at, p, 3 + q] += size * (2.0 * u[p] * v[q] - v[p] * u[q] - uv * same)
            blocks[at, 3 + p, q] += size * (2.0 * v[p] * u[q] - u[p] * v[q] - uv * same)


# Derivative of lagged friction by the start of a step: displacements, normals, weights and normal forces.
#
# With D = sum g_i (x_i - start_i) and w = sum g_i a_i of a pair, a the adjoint, the power of its force is
#
#     P = L f(|u|) u.w,    u = z + (I - n n') D,    f(y) = f0'(y)/y,    n = r/|r|
#
# z, 0 where contacts creep, and what the next step takes over come with adjoints of n and g that are added (`more`).
#
# It depends on the start of the displacements, by minus the Hessian; and on the pair's own twelve coordinates y_i at
# the start of the step, from which the limit L = mu F, the normal n and the weights g are lagged. By r and g, with q =
# f w + f' (u.w) u/|u| and L by its chain,
#
#     P_g_i = L ((I - n n') q . (x_i - start_i) + f u . a_i)
#     P_r   = L_r f u.w - L ((q.n) (I - n n') D + (D.n)(I - n n') q)/|r|
#
# and, as r = sum g_i y_i is the shortest over the feature's tangents t_a with dg = c_a dp_a (`distance`),
#
#     P_y_i = g_i P_r - sum_a (t_a . P_r + c_a . P_g) (g_i t_a + c_ai r)    (+ L's mollifier of nearly parallel edges).


@kernel
def by_lag(
    at, moves, adjoint, elements, weights, thresholds, n_points, factors, slips, more, offset, d_hat, least_gap, slip
):
    """Derivative of the power of all pairs by the positions `at` which they are lagged, (N, 3).

    moves: x - start; factors (p,): mu kappa; slips (p, 3): z; more (p, 7): adjoints of g and n; slip: displacement from
    which a contact slides; lengths in [m].
    """
    out = np.zeros_like(at)
    for e in range(len(elements)):
        points = four_points(at, elements, e)
        g, r = closest_points(points, e >= n_points)
        limit, by_distance, by_cross = _limit(points, r, weights[e], thresholds[e], offset, d_hat, least_gap)
        if not limit > 0.0:
            continue
        limit, by_distance, by_cross = factors[e] * limit, factors[e] * by_distance, factors[e] * by_cross
        d, a = four_points(moves, elements, e), four_points(adjoint, elements, e)
        z = slips[e, 0], slips[e, 1], slips[e, 2]
        by_r, by_g, per_limit = _differentiate_closest_points(g, r, d, a, z, limit, by_distance, slip)
        by_r, by_g = _add_adjoints(by_r, by_g, r, more[e])
        (has_first, t, c), (has_second, u, b) = tangent_directions(points, e >= n_points, g)
        first = dot(t, by_r) + _dot_four(c, by_g) if has_first else 0.0
        second = dot(u, by_r) + _dot_four(b, by_g) if has_second else 0.0
        for i in range(4):
            row = natural(elements[e, i])
            along = first * c[i] + second * b[i]
            for k in range(3):
                out[row, k] += g[i] * (by_r[k] - first * t[k] - second * u[k]) - along * r[k]
        if by_cross != 0.0:
            du, dv = cross_squared_gradient(*edges(points))
            slope = per_limit * by_cross
            for k in range(3):
                out[natural(elements[e, 0]), k] -= slope * du[k]
                out[natural(elements[e, 1]), k] += slope * du[k]
                out[natural(elements[e, 2]), k] -= slope * dv[k]
                out[natural(elements[e, 3]), k] += slope * dv[k]
    return out


@part
def _limit(points, r, weight, threshold, offset, d_hat, least_gap):
    """-w m db/dd of `barrier_kernels.normal_forces`, its derivatives by |r| and by the squared cross product."""
    length = np.sqrt(dot(r, r))
    distance = max(length, offset + least_gap)
    s, s_hat = distance * distance - offset * offset, d_hat * (2.0 * offset + d_hat)
    if s >= s_hat:
        return 0.0, 0.0, 0.0
    m, dm = 1.0, 0.0
    if threshold > 0.0:
        ratio = cross_squared(points) / threshold
        if ratio < 1.0:
            m, dm, _ = mollifier(ratio, threshold)
    _, first, second = barrier(s, s_hat, d_hat)
    slope = -2.0 * weight * first * distance
    by_distance = -2.0 * weight * m * (first + 2.0 * second * distance * distance) if length == distance else 0.0
    return m * slope, by_distance, dm * slope


@part
def _add_adjoints(by_r, by_g, r, more):
    """Derivatives by r (3) and g (4) with adjoints of g and of r/|r| added, more (7)."""
    length = np.sqrt(dot(r, r))
    by_n = more[4] / length, more[5] / length, more[6] / length
    along = dot(by_n, r) / (length * length)
    by_r = by_r[0] + by_n[0] - along * r[0], by_r[1] + by_n[1] - along * r[1], by_r[2] + by_n[2] - along * r[2]
    return by_r, (by_g[0] + more[0], by_g[1] + more[1], by_g[2] + more[2], by_g[3] + more[3])


@part
def _differentiate_closest_points(g, r, d, a, z, limit, by_distance, slip):
    """Derivatives of P by r (3) and by g (4), and P/L."""
    length = np.sqrt(dot(r, r))
    n = r[0] / length, r[1] / length, r[2] / length
    moved, w = _combined(g, d), _combined(g, a)
    normal = dot(moved, n)
    across = moved[0] - normal * n[0], moved[1] - normal * n[1], moved[2] - normal * n[2]
    u = z[0] + across[0], z[1] + across[1], z[2] + across[2]
    y, power = np.sqrt(dot(u, u)), dot(u, w)
    if y >= slip:
        f, slope = 1.0 / y, -power / (y * y * y)
    else:
        f, slope = (2.0 - y / slip) / slip, (-power / (slip * slip * y) if y > 0.0 else 0.0)
    q = f * w[0] + slope * u[0], f * w[1] + slope * u[1], f * w[2] + slope * u[2]
    out = dot(q, n)
    q = q[0] - out * n[0], q[1] - out * n[1], q[2] - out * n[2]
    by_length, turn = by_distance * f * power, limit / length
    by_r = (
        by_length * n[0] - turn * (out * across[0] + normal * q[0]),
        by_length * n[1] - turn * (out * across[1] + normal * q[1]),
        by_length * n[2] - turn * (out * across[2] + normal * q[2]),
    )
    by_g = (
        limit * (dot(q, d[0]) + f * dot(u, a[0])),
        limit * (dot(q, d[1]) + f * dot(u, a[1])),
        limit * (dot(q, d[2]) + f * dot(u, a[2])),
        limit * (dot(q, d[3]) + f * dot(u, a[3])),
    )
    return by_r, by_g, f * power


@part
def _combined(g, x):
    """Sum of g_i x_i."""
    p, a, b, c = x
    return (
        g[0] * p[0] + g[1] * a[0] + g[2] * b[0] + g[3] * c[0],
        g[0] * p[1] + g[1] * a[1] + g[2] * b[1] + g[3] * c[1],
        g[0] * p[2] + g[1] * a[2] + g[2] * b[2] + g[3] * c[2],
    )


@part
def _dot_four(c, g):
    return c[0] * g[0] + c[1] * g[1] + c[2] * g[2] + c[3] * g[3]
