"""Kernels of a triangle: deformation gradient, principal stretches, blocks of their modes, Neo-Hookean density.

F = [x1 - x0, x2 - x0] Dm^-1 (3x2), columns f1, f2; F = W' diag(s1, s2) V'.
"""

import numpy as np

from clothsim.base.jit import LANES, inlined, natural, part
from clothsim.physics.energies.hessians import point, write


@inlined
def deformation_gradient(x, triangle, B, F):
    """F[:, 0] = e1 B00 + e2 B10, F[:, 1] = e1 B01 + e2 B11, with B = Dm^-1."""
    i, j, m = natural(triangle[0]), natural(triangle[1]), natural(triangle[2])
    for k in range(3):
        e1, e2 = x[j, k] - x[i, k], x[m, k] - x[i, k]
        F[k, 0] = e1 * B[0, 0] + e2 * B[1, 0]
        F[k, 1] = e1 * B[0, 1] + e2 * B[1, 1]


@inlined
def products(F):
    """F'F: f1.f1, f1.f2, f2.f2."""
    c11 = c12 = c22 = 0.0
    for k in range(3):
        c11 += F[k, 0] * F[k, 0]
        c12 += F[k, 0] * F[k, 1]
        c22 += F[k, 1] * F[k, 1]
    return c11, c12, c22


@inlined
def normal(F, n):
    """n = f1 x f2 / J; returns J, the area ratio."""
    n[0] = F[1, 0] * F[2, 1] - F[2, 0] * F[1, 1]
    n[1] = F[2, 0] * F[0, 1] - F[0, 0] * F[2, 1]
    n[2] = F[0, 0] * F[1, 1] - F[1, 0] * F[0, 1]
    J = np.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
    for k in range(3):
        n[k] /= J
    return J


@inlined
def principal(F, n, J, V, W):
    """F = W' diag(s1, s2) V', s1 >= s2, the rows of W being w1, w2; V from the angle of C = F'F, s2 = J/s1."""
    c11, c12, c22 = products(F)
    c, s = half_angle(2.0 * c12, c11 - c22)
    V[0, 0], V[1, 0], V[0, 1], V[1, 1] = c, s, -s, c
    s1 = 0.0
    for k in range(3):
        W[0, k] = F[k, 0] * c + F[k, 1] * s
        s1 += W[0, k] * W[0, k]
    s1 = np.sqrt(s1)
    for k in range(3):
        W[0, k] /= s1
    W[1, 0] = n[1] * W[0, 2] - n[2] * W[0, 1]
    W[1, 1] = n[2] * W[0, 0] - n[0] * W[0, 2]
    W[1, 2] = n[0] * W[0, 1] - n[1] * W[0, 0]
    return s1, J / s1


@inlined
def principal_rates(B, V, alpha, beta):
    """Shape-function gradients along v1 and v2: alpha, beta (3,), rows of Dm^-1 V; that of corner 0 closes the sum."""
    for k in range(2):
        alpha[k + 1] = B[k, 0] * V[0, 0] + B[k, 1] * V[1, 0]
        beta[k + 1] = B[k, 0] * V[0, 1] + B[k, 1] * V[1, 1]
    alpha[0], beta[0] = -alpha[1] - alpha[2], -beta[1] - beta[2]


@inlined
def principal_state(x, triangle, B, F, n, V, W, alpha, beta):
    """Fill in F, its frames and the shape-function gradients; returns s1 and s2."""
    deformation_gradient(x, triangle, B, F)
    s1, s2 = principal(F, n, normal(F, n), V, W)
    principal_rates(B, V, alpha, beta)
    return s1, s2


VALUES_PER_LANE = 23
"""Numbers of a triangle that determine its block: W, n, shape-function gradients, area and modes."""


@inlined
def store_lane(lane_values, lane, area, alpha, beta, W, n, stretch, others):
    """Store the numbers of a triangle that `fill_lanes` needs: its lane of lane_values (VALUES_PER_LANE LANES,)."""
    for k in range(3):
        lane_values[k * LANES + lane], lane_values[(3 + k) * LANES + lane], lane_values[(6 + k) * LANES + lane] = (
            W[0, k],
            W[1, k],
            n[k],
        )
        lane_values[(9 + k) * LANES + lane], lane_values[(12 + k) * LANES + lane] = alpha[k], beta[k]
        lane_values[(15 + k) * LANES + lane] = stretch[k]
    for k in range(4):
        lane_values[(18 + k) * LANES + lane] = others[k]
    lane_values[22 * LANES + lane] = area


@inlined
def fill_lanes(out, lane_values):
    """Fill a group of `LanesHessian` from the stored numbers of its triangles."""
    for lane in range(LANES):
        w1, w2, n = point(lane_values, 0, lane), point(lane_values, 3, lane), point(lane_values, 6, lane)
        alpha, beta, stretch = point(lane_values, 9, lane), point(lane_values, 12, lane), point(lane_values, 15, lane)
        others, area = (*point(lane_values, 18, lane), lane_values[21 * LANES + lane]), lane_values[22 * LANES + lane]
        b00, b01, b02, b11, b12, b22 = principal_blocks(area, alpha, beta, w1, w2, n, stretch, others)
        write(out, 0, lane, b00)
        write(out, 1, lane, b01)
        write(out, 2, lane, b02)
        write(out, 3, lane, b11)
        write(out, 4, lane, b12)
        write(out, 5, lane, b22)


@inlined
def principal_blocks(area, alpha, beta, w1, w2, n, stretch, others):
    """A triangle's blocks 00, 01, 02, 11, 12, 22, three rows each, from its modes.

    stretch (a, b, c), others (twist, flip, out_1, out_2): [[a, b], [b, c]] over (w1 v1, w2 v2), twist and flip over
    (w2 v1, w1 v2), out_i over n v_i. The rows and columns of corner 0 follow from invariance under translation.
    """
    b11 = _modes(area, (alpha[1], beta[1]), (alpha[1], beta[1]), w1, w2, n, stretch, others)
    b12 = _modes(area, (alpha[1], beta[1]), (alpha[2], beta[2]), w1, w2, n, stretch, others)
    b22 = _modes(area, (alpha[2], beta[2]), (alpha[2], beta[2]), w1, w2, n, stretch, others)
    b01, b02 = _closing(b11, _transposed(b12)), _closing(b12, b22)
    return _closing(b01, b02), b01, b02, b11, b12, b22


@part
def _modes(area, p, q, w1, w2, n, stretch, others):
    """The block of two corners with shape-function gradients p and q along v1 and v2."""
    a, b, c = stretch
    twist, flip, out1, out2 = others
    same, swap = 0.5 * (flip + twist), 0.5 * (flip - twist)
    aa, ab, ba, bb = area * p[0] * q[0], area * p[0] * q[1], area * p[1] * q[0], area * p[1] * q[1]
    k11, k22, knn = a * aa + same * bb, c * bb + same * aa, out1 * aa + out2 * bb
    k12, k21 = b * ab + swap * ba, b * ba + swap * ab
    return (
        _row(k11 * w1[0] + k21 * w2[0], w1, k12 * w1[0] + k22 * w2[0], w2, knn * n[0], n),
        _row(k11 * w1[1] + k21 * w2[1], w1, k12 * w1[1] + k22 * w2[1], w2, knn * n[1], n),
        _row(k11 * w1[2] + k21 * w2[2], w1, k12 * w1[2] + k22 * w2[2], w2, knn * n[2], n),
    )


@part
def _row(x, u, y, v, z, w):
    """x u + y v + z w."""
    return x * u[0] + y * v[0] + z * w[0], x * u[1] + y * v[1] + z * w[1], x * u[2] + y * v[2] + z * w[2]


@part
def _closing(a, b):
    """-(a + b), the block that makes the sum of three zero."""
    return (
        (-a[0][0] - b[0][0], -a[0][1] - b[0][1], -a[0][2] - b[0][2]),
        (-a[1][0] - b[1][0], -a[1][1] - b[1][1], -a[1][2] - b[1][2]),
        (-a[2][0] - b[2][0], -a[2][1] - b[2][1], -a[2][2] - b[2][2]),
    )


@part
def _transposed(a):
    return (a[0][0], a[1][0], a[2][0]), (a[0][1], a[1][1], a[2][1]), (a[0][2], a[1][2], a[2][2])


@part
def half_angle(y, x):
    """cos and sin of atan2(y, x) / 2, without either."""
    length = np.hypot(x, y)  # squares would overflow: the arguments may be 1e200
    if not length > 0.0:
        return 1.0, 0.0
    if x >= 0.0:
        c = np.sqrt(0.5 + 0.5 * x / length)
        return c, 0.5 * y / (length * c)
    s = np.sqrt(0.5 - 0.5 * x / length) * (-1.0 if y < 0.0 else 1.0)
    return 0.5 * y / (length * s), s


@part
def project_2x2(a, b, c):
    """The nearest positive semi-definite [[a, b], [b, c]]: negative eigenvalues set to zero."""
    middle, radius = 0.5 * (a + c), np.hypot(0.5 * (a - c), b)
    low, high = middle - radius, middle + radius
    if low >= 0.0:
        return a, b, c
    if high <= 0.0:
        return 0.0, 0.0, 0.0
    scale = high / (high - low)
    return scale * (a - low), scale * b, scale * (c - low)


# Compressible Neo-Hookean sheet: the energy density and its derivatives in principal stretches.
#
#     psi(F) = mu/2 (I1 - 2 - 2 ln J) + lam/2 (ln J)^2,    I1 = tr F'F,  J = sqrt(det F'F),  F (3x2)
#     psi_i  = mu s_i + b / s_i,                           b = lam ln J - mu
#
# (docs/results/validation.md, A1; eigen-system of the Hessian in F: Smith, de Goes, Kim 2019, "Analytic eigensystems
# for isotropic distortion energies", for 3x2 F.) mu, lam [N/m] per reference area; s1, s2 the stretches.


TWIST, FLIP, OUT_1, OUT_2 = 0, 1, 2, 3


@inlined
def density(mu, lam, e11, e12, e22, J):
    """psi [J/m2] from E = C - 1 and J; +inf where the triangle has no area.

    I1 - 2 = tr E and 2 ln J = ln(1 + tr E + det E): from the same E, so that near rest, where both nearly cancel, the
    round-off of E is not amplified. Taken from F:F and J, psi would have an error of mu eps, far above its own value.
    """
    if not J > 0.0:
        return np.inf
    if max(abs(e11), abs(e12), abs(e22)) < 0.5:
        log_J = 0.5 * np.log1p(e11 + e22 + (e11 * e22 - e12 * e12))
    else:
        log_J = np.log(J)
    return 0.5 * mu * (e11 + e22 - 2.0 * log_J) + 0.5 * lam * log_J * log_J


@inlined
def inverse_factor(mu, lam, J):
    """b = lam ln J - mu in the stress P = mu F + b F C^-1 [N/m]."""
    return lam * np.log(J) - mu


@inlined
def stretch_block(mu, lam, s1, s2):
    """psi_11, psi_12, psi_22 [N/m]: the Hessian over the two stretch modes w_i v_i'."""
    b = lam * np.log(s1 * s2) - mu
    return mu + (lam - b) / (s1 * s1), lam / (s1 * s2), mu + (lam - b) / (s2 * s2)


@inlined
def other_modes(mu, lam, s1, s2):
    """The eigenvalues of twist, flip and the two out-of-plane modes [N/m], free of cancellation.

    twist (psi1 + psi2)/(s1 + s2) = mu + b/(s1 s2);  flip (psi1 - psi2)/(s1 - s2) = mu - b/(s1 s2), also where s1 = s2;
    out of plane psi_i/s_i = mu + b/s_i^2: negative in compression, these are the wrinkling modes.
    """
    b = lam * np.log(s1 * s2) - mu
    return mu + b / (s1 * s2), mu - b / (s1 * s2), mu + b / (s1 * s1), mu + b / (s2 * s2)
