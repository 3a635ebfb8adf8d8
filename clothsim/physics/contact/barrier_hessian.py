"""Hessian of the barrier from the closest-point records of its pairs (`barrier_kernels.evaluate`).

Without a mollifier the block of a pair is 4 b'' gg'rr' + 2 b' (gg'I - sum G G'), G = g t + c r (see `distance`), with
b' < 0 < b''. PSD projection in closed form: along gg'rr' the positive part is kept; each tangent t leaves 2|b'| (G G' -
gg't t'), which in the directions g t and c r is |r||g||c| off the diagonal and |r|^2 |c|^2 on it: its positive
eigenpair is known. Tangents along which the closest points do not move have -2|b'| gg't t' alone, which projects to 0.
So the projection has at most three rank-one factors; that of mollified pairs, and of those with a negative weight
(`distinct_features`), is found by their eigenvalues.
"""

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.jit import kernel, part
from clothsim.base.vectors import dot, four_points
from clothsim.physics.contact.barrier_kernels import (
    CROSS_RATIO,
    DIFFERENCE,
    FIRST,
    SECOND,
    VALUE,
    cross_squared_gradient,
    edges,
    mollifier,
)
from clothsim.physics.contact.distance import tangent_directions
from clothsim.physics.contact.psd_projection import positive_factors
from clothsim.physics.contact.relative_coordinates import absolute_block, relative
from clothsim.physics.energies.hessians import ElementHessian, LowRankHessian, room_for


def projected(
    records: Floats, x: Floats, elements: Ints, thresholds: Floats, n_points: int, kappa: float
) -> LowRankHessian:
    """Positive semi-definite Hessian, pair by pair no smaller than the exact one [N/m]."""
    others = np.flatnonzero((records[:, CROSS_RATIO] < 1.0) | (records[:, FIRST] > 0.0))
    factors = np.empty((3 * (len(elements) - len(others)) + 9 * len(others), 12))
    first, count = np.empty((2, len(elements)), np.int64)
    n_factors = rank_one_factors(factors, first, count, records, x, elements, n_points, kappa)
    if len(others):
        blocks = np.empty((len(others), 9, 9))
        relative_blocks(blocks, others, records, x, elements, thresholds, n_points, kappa)
        n_factors = positive_factors(blocks, others, factors, n_factors, first, count)
    return LowRankHessian(elements, first, count, factors[:n_factors])


def exact(
    records: Floats, x: Floats, elements: Ints, thresholds: Floats, n_points: int, kappa: float
) -> ElementHessian:
    """Exact Hessian [N/m]."""
    blocks = room_for(elements)
    exact_blocks(blocks, records, x, elements, thresholds, n_points, kappa)
    return ElementHessian(elements, blocks)


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
    _fill_mollifier_vectors(factors, cross_squared_gradient(*edges(points)), dm, 2.0 * slope * dm, b * d2m)
    first, second = tangent_scale * has_first, tangent_scale * has_second
    _sum_outer_products(blocks, at, factors, 4.0 * m * curvature, first, second, 2.0 * slope * dm)
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
def _fill_mollifier_vectors(factors, gradient, dm, distance_scale, cross_scale):
    """dc, 0 without a mollifier. The edges are sqrt 2 times the first two coordinates."""
    du, dv = gradient
    root = np.sqrt(2.0) if dm > 0.0 else 0.0
    for p in range(3):
        factors[3, p], factors[3, 3 + p], factors[3, 6 + p] = root * du[p], root * dv[p], 0.0
    for i in range(9):
        factors[4, i] = distance_scale * factors[0, i] + cross_scale * factors[3, i]


@part
def _sum_outer_products(blocks, at, factors, normal_scale, first_scale, second_scale, distance_scale):
    """Sum of the outer products of the vectors, without the isotropic part."""
    for i in range(9):
        normal = normal_scale * factors[0, i]
        tangent1, tangent2 = first_scale * factors[1, i], second_scale * factors[2, i]
        cross, distance = factors[3, i], distance_scale * factors[0, i]
        for j in range(9):
            of_distance = normal * factors[0, j] + tangent1 * factors[1, j] + tangent2 * factors[2, j]
            blocks[at, i, j] = of_distance + cross * factors[4, j] + distance * factors[3, j]


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
