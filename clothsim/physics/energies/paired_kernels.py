"""Element loops of the membrane on pairs of triangles: value, gradient and Hessian blocks.

An element is four vertices with three parts of constant deformation gradient: the quadrilateral as a whole, and its two
triangles. F = sum over vertices of x_v g_v', g_v (2,) the gradients of a part's shape functions. E = sum of weight
psi(F),

    psi = mu/2 (tr C - 2 - ln det C) + lam/8 (ln det C)^2,      C = F'F
    S = 2 dpsi/dC = mu 1 + c C^-1,    c = lam/2 ln det C - mu

The in-plane hourglass stiffness of a pair is apart. The deformation gradients of two triangles with a common edge
differ by q m', m (2,) the normal of that edge at rest and q = sum over the four vertices of c_v x_v, the hourglass mode
(Flanagan and Belytschko 1981). With F the mean of the pair, p = F'q is its part in the tangent plane, pulled back. To
second order the triangles resist it by

    E = weight (mu |sym(p m')|^2 + lam/2 (p . m)^2) = weight/2 (mu |p|^2 + (mu + lam) (p . m)^2)

with weight = A w1 w2, w1 and w2 the fractions of the area A. The normal part of q, a bend across the common edge, has
no energy here. Where a pair is folded it has no tangent plane, and the stiffness would lock folds as fine as the mesh:
E is divided by d = 1 + |q|^2 / FOLD^2, |q| = 2 sin(angle/2) for a fold along the common edge.
"""

import numpy as np

from clothsim.base.jit import inlined, kernel
from clothsim.physics.energies.triangle_kernels import density, inverse_factor, project_2x2


@inlined
def _deformation(x, vertices, rates, F):
    """F (3, 2); returns E = C - 1 as E11, E12, E22, and J."""
    F[:, :] = 0.0
    for v in range(4):
        for k in range(3):
            F[k, 0] += x[vertices[v], k] * rates[v, 0]
            F[k, 1] += x[vertices[v], k] * rates[v, 1]
    e11, e12, e22 = -1.0, 0.0, -1.0
    for k in range(3):
        e11 += F[k, 0] * F[k, 0]
        e12 += F[k, 0] * F[k, 1]
        e22 += F[k, 1] * F[k, 1]
    return e11, e12, e22, np.sqrt(max((1.0 + e11) * (1.0 + e22) - e12 * e12, 0.0))


@kernel
def value(x, elements, rates, weights, mu, lam):
    """E(x) [J]; +inf where a part has lost its area."""
    F = np.empty((3, 2))
    total = 0.0
    for t in range(len(elements)):
        for part in range(rates.shape[1]):
            if weights[t, part] > 0.0:
                e11, e12, e22, J = _deformation(x, elements[t], rates[t, part], F)
                total += weights[t, part] * density(mu[t], lam[t], e11, e12, e22, J)
    return total


@kernel
def gradient(x, elements, rates, weights, mu, lam):
    """dE/dx_v = sum of weight F S g_v, (N, 3) [N]."""
    out = np.zeros_like(x)
    F = np.empty((3, 2))
    for t in range(len(elements)):
        for part in range(rates.shape[1]):
            if weights[t, part] > 0.0:
                e11, e12, e22, J = _deformation(x, elements[t], rates[t, part], F)
                b = inverse_factor(mu[t], lam[t], J) / (J * J)
                s11, s12, s22 = mu[t] + b * (1.0 + e22), -b * e12, mu[t] + b * (1.0 + e11)
                for k in range(3):
                    P1 = weights[t, part] * (F[k, 0] * s11 + F[k, 1] * s12)
                    P2 = weights[t, part] * (F[k, 0] * s12 + F[k, 1] * s22)
                    for v in range(4):
                        out[elements[t, v], k] += P1 * rates[t, part, v, 0] + P2 * rates[t, part, v, 1]
    return out


@kernel
def hessian(x, elements, rates, weights, mu, lam, project):
    """Blocks (m, 12, 12) of d2E/dx2, the sum of all parts; with `project` of positive semi-definite ones."""
    blocks = np.zeros((len(elements), 12, 12))
    F, strain = np.empty((3, 2)), np.empty((3, 12))
    for t in range(len(elements)):
        for part in range(rates.shape[1]):
            if weights[t, part] > 0.0:
                _add(blocks[t], x, elements[t], rates[t, part], weights[t, part], mu[t], lam[t], project, F, strain)
    return blocks


@kernel
def _add(block, x, vertices, rates, weight, mu, lam, project, F, strain):
    """Add the second derivatives of weight psi(F): S on the rates, and the tangent on the strains.

    dS = lam/2 tr(C^-1 dC) C^-1 - c C^-1 dC C^-1. With L the symmetric root of C^-1 and M = L dC L / 2 that adds
    lam (tr M)^2 - 2 c |M|^2: positive where c <= 0. So with `project` c is at most 0, and S has no negative part.
    """
    e11, e12, e22, J = _deformation(x, vertices, rates, F)
    c = inverse_factor(mu, lam, J)
    i11, i12, i22 = (1.0 + e22) / (J * J), -e12 / (J * J), (1.0 + e11) / (J * J)
    s11, s12, s22 = mu + c * i11, c * i12, mu + c * i22
    if project:
        s11, s12, s22 = project_2x2(s11, s12, s22)
        c = min(c, 0.0)
    # the root of a 2x2 matrix: (M + sqrt(det M) 1) / sqrt(tr M + 2 sqrt(det M)), and det C^-1 = 1/J^2
    scale = 1.0 / np.sqrt(i11 + i22 + 2.0 / J)
    l11, l12, l22 = (i11 + 1.0 / J) * scale, i12 * scale, (i22 + 1.0 / J) * scale
    for v in range(4):
        g1, g2 = rates[v, 0], rates[v, 1]
        a, b = l11 * g1 + l12 * g2, l12 * g1 + l22 * g2
        for k in range(3):
            f1, f2 = F[k, 0] * l11 + F[k, 1] * l12, F[k, 0] * l12 + F[k, 1] * l22
            strain[0, 3 * v + k] = f1 * a
            strain[1, 3 * v + k] = f2 * b
            strain[2, 3 * v + k] = (f1 * b + f2 * a) / np.sqrt(2.0)
        for u in range(4):
            h1, h2 = rates[u, 0], rates[u, 1]
            geometric = weight * (s11 * g1 * h1 + s12 * (g1 * h2 + g2 * h1) + s22 * g2 * h2)
            for k in range(3):
                block[3 * v + k, 3 * u + k] += geometric
    for p in range(12):
        trace = strain[0, p] + strain[1, p]
        for q in range(12):
            square = strain[0, p] * strain[0, q] + strain[1, p] * strain[1, q] + strain[2, p] * strain[2, q]
            block[p, q] += weight * (lam * trace * (strain[0, q] + strain[1, q]) - 2.0 * c * square)


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
def hourglass_value(x, elements, rates, hourglass, normals, weights, mu, lam):
    """E(x) [J]."""
    F, q, p, stress = np.empty((3, 2)), np.empty(3), np.empty(2), np.empty(2)
    total = 0.0
    for t in range(len(elements)):
        if weights[t] > 0.0:
            W, d = _mode(x, elements[t], rates[t, 0], hourglass[t], normals[t], mu[t], lam[t], F, q, p, stress)
            total += weights[t] * W / d
    return total


@kernel
def add_hourglass_gradient(out, x, elements, rates, hourglass, normals, weights, mu, lam):
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
def add_hourglass_hessian(blocks, x, elements, rates, hourglass, normals, weights, mu, lam, project):
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
