"""What the element loops over triangles share: F, its principal stretches and directions, and the block of their modes.

F = [x1 - x0, x2 - x0] Dm^-1 (3x2), columns f1, f2; F = W' diag(s1, s2) V'.
"""

import numpy as np
from numba import njit

from clothsim.compiled import part


@njit(cache=True, error_model="numpy", inline="always")
def deformation_gradient(x, triangle, B, F):
    """F[:, 0] = e1 B00 + e2 B10, F[:, 1] = e1 B01 + e2 B11, with B = Dm^-1."""
    for k in range(3):
        e1 = x[triangle[1], k] - x[triangle[0], k]
        e2 = x[triangle[2], k] - x[triangle[0], k]
        F[k, 0] = e1 * B[0, 0] + e2 * B[1, 0]
        F[k, 1] = e1 * B[0, 1] + e2 * B[1, 1]


@njit(cache=True, error_model="numpy", inline="always")
def products(F):
    """F'F: f1.f1, f1.f2, f2.f2."""
    c11 = c12 = c22 = 0.0
    for k in range(3):
        c11 += F[k, 0] * F[k, 0]
        c12 += F[k, 0] * F[k, 1]
        c22 += F[k, 1] * F[k, 1]
    return c11, c12, c22


@njit(cache=True, error_model="numpy", inline="always")
def normal(F, n):
    """n = f1 x f2 / J; returns J, the area ratio."""
    n[0] = F[1, 0] * F[2, 1] - F[2, 0] * F[1, 1]
    n[1] = F[2, 0] * F[0, 1] - F[0, 0] * F[2, 1]
    n[2] = F[0, 0] * F[1, 1] - F[1, 0] * F[0, 1]
    J = np.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
    for k in range(3):
        n[k] /= J
    return J


@njit(cache=True, error_model="numpy", inline="always")
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


@njit(cache=True, error_model="numpy", inline="always")
def principal_rates(B, V, alpha, beta):
    """The rates of each corner along v1 and v2: alpha, beta (3,) are the rows of Dm^-1 V, that of corner 0 closing."""
    for k in range(2):
        alpha[k + 1] = B[k, 0] * V[0, 0] + B[k, 1] * V[1, 0]
        beta[k + 1] = B[k, 0] * V[0, 1] + B[k, 1] * V[1, 1]
    alpha[0], beta[0] = -alpha[1] - alpha[2], -beta[1] - beta[2]


@njit(cache=True, error_model="numpy", inline="always")
def principal_block(block, area, alpha, beta, W, n, stretch, others):
    """A triangle's (9, 9) block from its modes: stretch (a, b, c), others (twist, flip, out_1, out_2).

    [[a, b], [b, c]] over (w1 v1, w2 v2), twist and flip over (w2 v1, w1 v2), out_i over n v_i; W's rows are w1, w2.
    """
    a, b, c = stretch
    twist, flip, out1, out2 = others
    same, swap = 0.5 * (flip + twist), 0.5 * (flip - twist)
    for p in range(1, 3):
        for q in range(p, 3):
            aa, ab = area * alpha[p] * alpha[q], area * alpha[p] * beta[q]
            ba, bb = area * beta[p] * alpha[q], area * beta[p] * beta[q]
            k11, k22, knn = a * aa + same * bb, c * bb + same * aa, out1 * aa + out2 * bb
            k12, k21 = b * ab + swap * ba, b * ba + swap * ab
            for i in range(3):
                r1 = k11 * W[0, i] + k21 * W[1, i]
                r2 = k12 * W[0, i] + k22 * W[1, i]
                rn = knn * n[i]
                for j in range(3):
                    entry = r1 * W[0, j] + r2 * W[1, j] + rn * n[j]
                    block[3 * p + i, 3 * q + j] = entry
                    block[3 * q + j, 3 * p + i] = entry
    for i in range(3):  # corner 0 from rest under translation
        for j in range(3, 9):
            block[i, j] = -block[3 + i, j] - block[6 + i, j]
            block[j, i] = block[i, j]
    for i in range(3):
        for j in range(3):
            block[i, j] = -block[i, 3 + j] - block[i, 6 + j]


@part
def half_angle(y, x):
    """cos and sin of atan2(y, x) / 2, without either."""
    length = np.hypot(x, y)  # no square: they may be 1e200
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
    share = high / (high - low)
    return share * (a - low), share * b, share * (c - low)
