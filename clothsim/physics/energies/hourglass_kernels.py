"""Element loops of the in-plane hourglass stiffness of pairs of triangles.

The deformation gradients of two triangles with a common edge differ by q m', m (2,) the normal of that edge at rest and
q = sum over the four vertices of c_v x_v, the hourglass mode (Flanagan and Belytschko 1981). With F the mean of the
pair, p = F'q is its part in the tangent plane, pulled back. To second order the triangles resist it by

    E = weight (mu |sym(p m')|^2 + lam/2 (p . m)^2) = weight/2 (mu |p|^2 + (mu + lam) (p . m)^2)

with weight = A w1 w2, w1 and w2 the fractions of the area A. The normal part of q, a bend across the common edge, has
no energy here. Where a pair is folded it has no tangent plane, and the stiffness would lock folds as fine as the mesh:
E is divided by d = 1 + |q|^2 / FOLD^2, |q| = 2 sin(angle/2) for a fold along the common edge.
"""

import numpy as np

from clothsim.base.jit import inlined, kernel

FOLD = 0.1
"""Hourglass mode |q| from which a pair counts as folded, about the angle between its triangles [rad]."""


@inlined
def _mode(x, vertices, mean, hourglass, normal, mu, lam, F, q, p, stress):
    """F (3, 2), q (3,), p (2,) and the stress dW/dp (2,) of W = E d / weight; returns W and d."""
    F[:, :] = 0.0
    q[:] = 0.0
    for v in range(4):
        for k in range(3):
            F[k, 0] += x[vertices[v], k] * mean[v, 0]
            F[k, 1] += x[vertices[v], k] * mean[v, 1]
            q[k] += x[vertices[v], k] * hourglass[v]
    p[0], p[1], square = 0.0, 0.0, 0.0
    for k in range(3):
        p[0] += F[k, 0] * q[k]
        p[1] += F[k, 1] * q[k]
        square += q[k] * q[k]
    across = (mu + lam) * (p[0] * normal[0] + p[1] * normal[1])
    stress[0], stress[1] = mu * p[0] + across * normal[0], mu * p[1] + across * normal[1]
    return 0.5 * (stress[0] * p[0] + stress[1] * p[1]), 1.0 + square / (FOLD * FOLD)


@kernel
def value(x, elements, rates, hourglass, normals, weights, mu, lam):
    """E(x) [J]."""
    F, q, p, stress = np.empty((3, 2)), np.empty(3), np.empty(2), np.empty(2)
    total = 0.0
    for t in range(len(elements)):
        if weights[t] > 0.0:
            W, d = _mode(x, elements[t], rates[t, 0], hourglass[t], normals[t], mu[t], lam[t], F, q, p, stress)
            total += weights[t] * W / d
    return total


@kernel
def add_gradient(out, x, elements, rates, hourglass, normals, weights, mu, lam):
    """Add weight (dW/dx_v / d - W dd/dx_v / d^2), dW/dx_v = sum of stress_i (g_vi q + c_v F_i), to (N, 3) [N]."""
    F, q, p, stress = np.empty((3, 2)), np.empty(3), np.empty(2), np.empty(2)
    for t in range(len(elements)):
        if weights[t] > 0.0:
            W, d = _mode(x, elements[t], rates[t, 0], hourglass[t], normals[t], mu[t], lam[t], F, q, p, stress)
            scale, softening = weights[t] / d, 2.0 * W / (d * FOLD * FOLD)
            for v in range(4):
                along = rates[t, 0, v, 0] * stress[0] + rates[t, 0, v, 1] * stress[1] - softening * hourglass[t, v]
                for k in range(3):
                    turned = hourglass[t, v] * (F[k, 0] * stress[0] + F[k, 1] * stress[1])
                    out[elements[t, v], k] += scale * (along * q[k] + turned)


@kernel
def add_hessian(blocks, x, elements, rates, hourglass, normals, weights, mu, lam, project):
    """Add d2E/dx2 to the blocks (m, 12, 12): the tangent on dp - p dd/d, the stress on d2p, and -W d2d / d^2.

    The tangent is positive. d2d = 2 c c' / FOLD^2 on the vertices: with `project` its negative is left out. The stress
    is on (a c' + c a'), a_v = stress . g_v, with the eigenvalues a.c + |a||c| and a.c - |a||c|: with `project` only the
    former remains, on the vector a / |a| + c / |c|.
    """
    F, q, p, stress = np.empty((3, 2)), np.empty(3), np.empty(2), np.empty(2)
    rows, a = np.empty((3, 12)), np.empty(4)
    for t in range(len(elements)):
        if weights[t] > 0.0:
            W, d = _mode(x, elements[t], rates[t, 0], hourglass[t], normals[t], mu[t], lam[t], F, q, p, stress)
            for v in range(4):
                a[v] = rates[t, 0, v, 0] * stress[0] + rates[t, 0, v, 1] * stress[1]
                for k in range(3):
                    change = 2.0 * hourglass[t, v] * q[k] / (d * FOLD * FOLD)
                    for i in range(2):
                        rows[i, 3 * v + k] = rates[t, 0, v, i] * q[k] + hourglass[t, v] * F[k, i] - p[i] * change
                    rows[2, 3 * v + k] = normals[t, 0] * rows[0, 3 * v + k] + normals[t, 1] * rows[1, 3 * v + k]
            for i in range(12):
                for j in range(12):
                    square = rows[0, i] * rows[0, j] + rows[1, i] * rows[1, j]
                    blocks[t, i, j] += weights[t] / d * (mu[t] * square + (mu[t] + lam[t]) * rows[2, i] * rows[2, j])
            _add_stress(blocks[t], a, hourglass[t], weights[t] / d, 2.0 * W / (d * FOLD * FOLD), project)


@inlined
def _add_stress(block, a, c, weight, softening, project):
    """Add weight (a c' + c a' - softening c c') to the equal components of all vertices, or a positive part of it."""
    inner, aa, cc = 0.0, 0.0, 0.0
    for v in range(4):
        inner += a[v] * c[v]
        aa += a[v] * a[v]
        cc += c[v] * c[v]
    if aa == 0.0:
        return
    ratio, scale = np.sqrt(aa / cc), 1.0
    if project:
        # (a + ratio c)(a + ratio c)' / (2 ratio) has the eigenvalue a.c + |a||c| and the vector of above
        scale = 0.5 / ratio
    for u in range(4):
        for v in range(4):
            if project:
                entry = scale * (a[u] + ratio * c[u]) * (a[v] + ratio * c[v])
            else:
                entry = a[u] * c[v] + c[u] * a[v] - softening * c[u] * c[v]
            for k in range(3):
                block[3 * u + k, 3 * v + k] += weight * entry
