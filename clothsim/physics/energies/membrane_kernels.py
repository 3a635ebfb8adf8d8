"""Element loops of the membrane: value, gradient and Hessian blocks of constant-strain triangles.

F = [x1 - x0, x2 - x0] Dm^-1 (3x2), columns f1, f2; E = sum A psi(F).
"""

import numpy as np

from clothsim.base.jit import LANES, inlined, kernel, natural
from clothsim.physics.energies.block_sums import add_lanes
from clothsim.physics.energies.triangle_kernels import (
    VALUES_PER_LANE,
    deformation_gradient,
    density,
    fill_lanes,
    inverse_factor,
    normal,
    other_modes,
    principal_state,
    products,
    project_2x2,
    store_lane,
    stretch_block,
)


@kernel
def value(x, triangles, inverses, areas, mu, lam):
    """Sum of A psi(F) [J]."""
    F, n = np.empty((3, 2)), np.empty(3)
    total = 0.0
    for t in range(len(triangles)):
        deformation_gradient(x, triangles[t], inverses[t], F)
        e11, e12, e22 = -1.0, 0.0, -1.0
        for k in range(3):
            e11 += F[k, 0] * F[k, 0]
            e12 += F[k, 0] * F[k, 1]
            e22 += F[k, 1] * F[k, 1]
        total += areas[t] * density(mu[t], lam[t], e11, e12, e22, normal(F, n))
    return total


@kernel
def gradient(x, triangles, inverses, areas, mu, lam):
    """A P Dm^-T on corners 1 and 2, minus their sum on corner 0, P = mu F + b F C^-1."""
    out = np.zeros_like(x)
    F, n = np.empty((3, 2)), np.empty(3)
    for t in range(len(triangles)):
        B = inverses[t]
        deformation_gradient(x, triangles[t], B, F)
        J = normal(F, n)
        b = inverse_factor(mu[t], lam[t], J) / (J * J)
        c11, c12, c22 = products(F)
        i, j, m = natural(triangles[t, 0]), natural(triangles[t, 1]), natural(triangles[t, 2])
        for k in range(3):
            P1 = mu[t] * F[k, 0] + b * (F[k, 0] * c22 - F[k, 1] * c12)
            P2 = mu[t] * F[k, 1] + b * (F[k, 1] * c11 - F[k, 0] * c12)
            g1 = areas[t] * (P1 * B[0, 0] + P2 * B[0, 1])
            g2 = areas[t] * (P1 * B[1, 0] + P2 * B[1, 1])
            out[i, k] -= g1 + g2
            out[j, k] += g1
            out[m, k] += g2
    return out


@kernel
def fill(lanes, first, x, triangles, inverses, areas, mu, lam, project):
    """`LanesHessian.fill` of d2E/dx2. With `project` the negative eigenvalues of d2psi/dF2 are set to zero first.

    In the frame w1, w2, n and with the shape-function gradients alpha, beta of the corners along v1, v2 (rows of Dm^-1
    V) the modes are block diagonal: stretch [[a, b], [b, c]] over (w1 v1, w2 v2), twist and flip over (w2 v1, w1 v2), n
    v1, n v2.
    """
    room, lane_values = room_of_triangle(), np.zeros(VALUES_PER_LANE * LANES)
    for group in range(len(lanes)):
        store_group(lane_values, first + group * LANES, room, x, triangles, inverses, areas, mu, lam, project)
        fill_lanes(lanes[group], lane_values)


@kernel
def add_triangles(data, at, x, triangles, inverses, areas, mu, lam, project):
    """`LanesHessian.add` of the same."""
    room, lane_values, lanes = room_of_triangle(), np.zeros(VALUES_PER_LANE * LANES), np.empty(54 * LANES)
    outside = 0
    for first in range(0, len(triangles), LANES):
        store_group(lane_values, first, room, x, triangles, inverses, areas, mu, lam, project)
        fill_lanes(lanes, lane_values)
        outside += add_lanes(data, at, first, lanes)
    return outside


@inlined
def room_of_triangle():
    """Room for F, n, V, W, alpha and beta of a triangle."""
    return np.empty((3, 2)), np.empty(3), np.empty((2, 2)), np.empty((2, 3)), np.empty(3), np.empty(3)


@inlined
def store_group(lane_values, begin, room, x, triangles, inverses, areas, mu, lam, project):
    """Store what the blocks of a group of triangles are computed from."""
    F, n, V, W, alpha, beta = room
    for lane in range(min(LANES, len(triangles) - begin)):
        t = begin + lane
        s1, s2 = principal_state(x, triangles[t], inverses[t], F, n, V, W, alpha, beta)
        a, b, c = stretch_block(mu[t], lam[t], s1, s2)
        twist, flip, out1, out2 = other_modes(mu[t], lam[t], s1, s2)
        if project:
            a, b, c = project_2x2(a, b, c)
            twist, flip, out1, out2 = max(twist, 0.0), max(flip, 0.0), max(out1, 0.0), max(out2, 0.0)
        store_lane(lane_values, lane, areas[t], alpha, beta, W, n, (a, b, c), (twist, flip, out1, out2))
