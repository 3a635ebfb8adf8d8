"""Element loops of the membrane: value, gradient and Hessian blocks of constant-strain triangles.

F = [x1 - x0, x2 - x0] Dm^-1 (3x2), columns f1, f2; E = sum A psi(F).
"""

import numpy as np
from numba import njit

from clothsim.energies.neo_hookean import density, inverse_factor, other_modes, stretch_block


@njit(cache=True, error_model="numpy", inline="always")
def _deformation_gradient(x, triangle, B, F):
    """F[:, 0] = e1 B00 + e2 B10, F[:, 1] = e1 B01 + e2 B11, with B = Dm^-1."""
    for k in range(3):
        e1 = x[triangle[1], k] - x[triangle[0], k]
        e2 = x[triangle[2], k] - x[triangle[0], k]
        F[k, 0] = e1 * B[0, 0] + e2 * B[1, 0]
        F[k, 1] = e1 * B[0, 1] + e2 * B[1, 1]


@njit(cache=True, error_model="numpy", inline="always")
def _normal(F, n):
    """n = f1 x f2 / J; returns J, the area ratio."""
    n[0] = F[1, 0] * F[2, 1] - F[2, 0] * F[1, 1]
    n[1] = F[2, 0] * F[0, 1] - F[0, 0] * F[2, 1]
    n[2] = F[0, 0] * F[1, 1] - F[1, 0] * F[0, 1]
    J = np.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
    for k in range(3):
        n[k] /= J
    return J


@njit(cache=True, error_model="numpy")
def value(x, triangles, inverses, areas, mu, lam):
    """Sum of A psi(F) [J]."""
    F, n = np.empty((3, 2)), np.empty(3)
    total = 0.0
    for t in range(len(triangles)):
        _deformation_gradient(x, triangles[t], inverses[t], F)
        e11, e12, e22 = -1.0, 0.0, -1.0
        for k in range(3):
            e11 += F[k, 0] * F[k, 0]
            e12 += F[k, 0] * F[k, 1]
            e22 += F[k, 1] * F[k, 1]
        total += areas[t] * density(mu[t], lam[t], e11, e12, e22, _normal(F, n))
    return total


@njit(cache=True, error_model="numpy")
def gradient(x, triangles, inverses, areas, mu, lam):
    """A P Dm^-T on corners 1 and 2, minus their sum on corner 0, P = mu F + b F C^-1."""
    out = np.zeros_like(x)
    F, n = np.empty((3, 2)), np.empty(3)
    for t in range(len(triangles)):
        B = inverses[t]
        _deformation_gradient(x, triangles[t], B, F)
        J = _normal(F, n)
        b = inverse_factor(mu[t], lam[t], J) / (J * J)
        c11 = c12 = c22 = 0.0
        for k in range(3):
            c11 += F[k, 0] * F[k, 0]
            c12 += F[k, 0] * F[k, 1]
            c22 += F[k, 1] * F[k, 1]
        for k in range(3):
            P1 = mu[t] * F[k, 0] + b * (F[k, 0] * c22 - F[k, 1] * c12)
            P2 = mu[t] * F[k, 1] + b * (F[k, 1] * c11 - F[k, 0] * c12)
            g1 = areas[t] * (P1 * B[0, 0] + P2 * B[0, 1])
            g2 = areas[t] * (P1 * B[1, 0] + P2 * B[1, 1])
            out[triangles[t, 0], k] -= g1 + g2
            out[triangles[t, 1], k] += g1
            out[triangles[t, 2], k] += g2
    return out


@njit(cache=True, error_model="numpy")
def hessian(x, triangles, inverses, areas, mu, lam, project):
    """Blocks (m, 9, 9) of d2E/dx2. With `project` the negative eigenvalues of d2psi/dF2 are set to zero first.

    In the frame Q = [w1 w2 n] and with corner a's rates alpha_a, beta_a along v1, v2 (rows of Dm^-1 V), the modes are
    block diagonal: stretch [[a, b], [b, c]] over (w1 v1, w2 v2), twist and flip over (w2 v1, w1 v2), n v1, n v2.
    """
    blocks = np.empty((len(triangles), 9, 9))
    F, n, V, W = np.empty((3, 2)), np.empty(3), np.empty((2, 2)), np.empty((2, 3))
    alpha, beta = np.empty(3), np.empty(3)
    for t in range(len(triangles)):
        B = inverses[t]
        _deformation_gradient(x, triangles[t], B, F)
        s1, s2 = _principal(F, n, _normal(F, n), V, W)
        for k in range(2):
            alpha[k + 1] = B[k, 0] * V[0, 0] + B[k, 1] * V[1, 0]
            beta[k + 1] = B[k, 0] * V[0, 1] + B[k, 1] * V[1, 1]
        alpha[0], beta[0] = -alpha[1] - alpha[2], -beta[1] - beta[2]
        a, b, c = stretch_block(mu[t], lam[t], s1, s2)
        twist, flip, out1, out2 = other_modes(mu[t], lam[t], s1, s2)
        if project:
            a, b, c = _project_2x2(a, b, c)
            twist, flip, out1, out2 = max(twist, 0.0), max(flip, 0.0), max(out1, 0.0), max(out2, 0.0)
        same, swap = 0.5 * (flip + twist), 0.5 * (flip - twist)
        for p in range(3):
            for q in range(3):
                aa, ab = areas[t] * alpha[p] * alpha[q], areas[t] * alpha[p] * beta[q]
                ba, bb = areas[t] * beta[p] * alpha[q], areas[t] * beta[p] * beta[q]
                k11, k22, knn = a * aa + same * bb, c * bb + same * aa, out1 * aa + out2 * bb
                k12, k21 = b * ab + swap * ba, b * ba + swap * ab
                for i in range(3):
                    r1 = k11 * W[0, i] + k21 * W[1, i]
                    r2 = k12 * W[0, i] + k22 * W[1, i]
                    rn = knn * n[i]
                    for j in range(3):
                        blocks[t, 3 * p + i, 3 * q + j] = r1 * W[0, j] + r2 * W[1, j] + rn * n[j]
    return blocks


@njit(cache=True, error_model="numpy", inline="always")
def _project_2x2(a, b, c):
    """The nearest positive semi-definite [[a, b], [b, c]]: negative eigenvalues set to zero."""
    angle = 0.5 * np.arctan2(2.0 * b, a - c)
    x, y = np.cos(angle), np.sin(angle)
    high = max(a * x * x + 2.0 * b * x * y + c * y * y, 0.0)
    low = max(a * y * y - 2.0 * b * x * y + c * x * x, 0.0)
    return high * x * x + low * y * y, (high - low) * x * y, high * y * y + low * x * x


@njit(cache=True, error_model="numpy", inline="always")
def _principal(F, n, J, V, W):
    """F = W' diag(s1, s2) V', s1 >= s2, the rows of W being w1, w2; V from the angle of C = F'F, s2 = J/s1."""
    c11 = c12 = c22 = 0.0
    for k in range(3):
        c11 += F[k, 0] * F[k, 0]
        c12 += F[k, 0] * F[k, 1]
        c22 += F[k, 1] * F[k, 1]
    angle = 0.5 * np.arctan2(2.0 * c12, c11 - c22)
    c, s = np.cos(angle), np.sin(angle)
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
