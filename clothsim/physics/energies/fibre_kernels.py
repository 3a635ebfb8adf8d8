"""Element loops of thread measures: stretches along warp and weft, and shear.

With F the deformation gradient and a, b the warp and the weft: u = F a, v = F b, and the measures
la = |u|, lb = |v| (thread stretches, the roots of I4 and I6) and I8 = u.v (shear). [u v] = [x1 - x0, x2 - x0] B with
B = Dm^-1 [a b].
"""

import numpy as np

from clothsim.base.jit import LANES, inlined, kernel, natural
from clothsim.physics.energies.block_sums import add_dense
from clothsim.physics.energies.membrane_kernels import room_of_triangle, store_group
from clothsim.physics.energies.triangle_kernels import (
    VALUES_PER_LANE,
    deformation_gradient,
    fill_lanes,
    products,
    project_2x2,
)


@kernel
def measures(x, triangles, inverses):
    """la, lb, I8 of each triangle, (m, 3)."""
    out = np.empty((len(triangles), 3))
    F = np.empty((3, 2))
    for t in range(len(triangles)):
        deformation_gradient(x, triangles[t], inverses[t], F)
        uu, uv, vv = products(F)
        out[t, 0], out[t, 1], out[t, 2] = np.sqrt(uu), np.sqrt(vv), uv
    return out


@kernel
def gradient(x, triangles, inverses, measured, slopes):
    """dE/dx from slopes (m, 3) = dE/d(la, lb, I8): dE/du = Ea u/la + E8 v, dE/dv = Eb v/lb + E8 u."""
    out = np.zeros_like(x)
    F = np.empty((3, 2))
    for t in range(len(triangles)):
        B = inverses[t]
        deformation_gradient(x, triangles[t], B, F)
        along_u, along_v, shear = slopes[t, 0] / measured[t, 0], slopes[t, 1] / measured[t, 1], slopes[t, 2]
        i, j, m = natural(triangles[t, 0]), natural(triangles[t, 1]), natural(triangles[t, 2])
        for k in range(3):
            du = along_u * F[k, 0] + shear * F[k, 1]
            dv = along_v * F[k, 1] + shear * F[k, 0]
            g1 = du * B[0, 0] + dv * B[0, 1]
            g2 = du * B[1, 0] + dv * B[1, 1]
            out[i, k] -= g1 + g2
            out[j, k] += g1
            out[m, k] += g2
    return out


@kernel
def hessian(x, triangles, inverses, measured, slopes, curvatures, project):
    """Blocks (m, 9, 9) of d2E/dx2 from slopes and curvatures (m, 4) = E_aa, E_ab, E_bb, E_88.

    Over (u, v), with the unit vectors u^ and v^,

        [E_aa u^u^'  E_ab u^v^']   [Ea/la (I - u^u^')         0       ]        [vv' vu']      [0 I]
        [E_ab v^u^'  E_bb v^v^'] + [       0          Eb/lb (I - v^v^')] + E_88 [uv' uu'] + E8 [I 0].

    The first two act on complementary spaces, so that with `project` the positive part of each is that of their sum;
    the positive part of the last is |E8|/2 [I +-I; +-I I]. Without shear this is the nearest semi-definite Hessian.
    """
    blocks, room = np.empty((len(triangles), 9, 9)), _room_of_threads()
    for t in range(len(triangles)):
        _fill_block(blocks, t, room, x, triangles, inverses, t, measured, slopes, curvatures, project)
    return blocks


@kernel
def add_threaded(data, at, x, triangles, shapes, areas, mu, lam, inverses, measured, slopes, curvatures, project):
    """`LanesHessian.add` of the threads and the Neo-Hookean sheet of the same triangles.

    shapes, areas, mu, lam: of the sheet, as of `membrane_kernels`.
    """
    room, lane_values, lanes = room_of_triangle(), np.zeros(VALUES_PER_LANE * LANES), np.empty(54 * LANES)
    threads, block, outside = _room_of_threads(), np.empty((1, 9, 9)), 0
    for first in range(0, len(triangles), LANES):
        store_group(lane_values, first, room, x, triangles, shapes, areas, mu, lam, project)
        fill_lanes(lanes, lane_values)
        for lane in range(min(LANES, len(triangles) - first)):
            t = first + lane
            _fill_block(block, 0, threads, x, triangles, inverses, t, measured, slopes, curvatures, project)
            number = 0
            for p in range(3):
                for q in range(p, 3):
                    for i in range(3):
                        for j in range(3):
                            row, column = (max(i, j), min(i, j)) if p == q else (i, j)  # as `hessians.unpack` leaves it
                            block[0, 3 * p + i, 3 * q + j] += lanes[(9 * number + 3 * row + column) * LANES + lane]
                    number += 1
            outside += add_dense(data, at, t, block.reshape(-1), 3)
    return outside


@inlined
def _room_of_threads():
    """Room for F, the matrices over (u, v) and the shape-function gradients along the threads of a triangle."""
    F, alpha, beta = np.empty((3, 2)), np.empty(3), np.empty(3)
    return F, np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), alpha, beta


@inlined
def _fill_block(blocks, to, room, x, triangles, inverses, t, measured, slopes, curvatures, project):
    """blocks[to] of triangle t."""
    F, uu, uv, vv, alpha, beta = room
    B = inverses[t]
    deformation_gradient(x, triangles[t], B, F)
    la, lb = measured[t, 0], measured[t, 1]
    across_u, across_v, shear = slopes[t, 0] / la, slopes[t, 1] / lb, slopes[t, 2]
    e_aa, e_ab, e_bb, e_88 = curvatures[t, 0], curvatures[t, 1], curvatures[t, 2], curvatures[t, 3]
    same = 0.0
    if project:
        e_aa, e_ab, e_bb = project_2x2(e_aa, e_ab, e_bb)
        across_u, across_v, e_88 = max(across_u, 0.0), max(across_v, 0.0), max(e_88, 0.0)
        same, shear = 0.5 * abs(shear), 0.5 * shear
    for i in range(3):
        for j in range(3):
            one = 1.0 if i == j else 0.0
            u2, v2 = F[i, 0] * F[j, 0], F[i, 1] * F[j, 1]
            uu[i, j] = (e_aa - across_u) * u2 / (la * la) + (across_u + same) * one + e_88 * v2
            vv[i, j] = (e_bb - across_v) * v2 / (lb * lb) + (across_v + same) * one + e_88 * u2
            uv[i, j] = e_ab * F[i, 0] * F[j, 1] / (la * lb) + e_88 * F[i, 1] * F[j, 0] + shear * one
    for k in range(2):
        alpha[k + 1], beta[k + 1] = B[k, 0], B[k, 1]
    alpha[0], beta[0] = -alpha[1] - alpha[2], -beta[1] - beta[2]
    for p in range(3):
        for q in range(3):
            aa, ab, ba, bb = alpha[p] * alpha[q], alpha[p] * beta[q], beta[p] * alpha[q], beta[p] * beta[q]
            for i in range(3):
                for j in range(3):
                    blocks[to, 3 * p + i, 3 * q + j] = aa * uu[i, j] + ab * uv[i, j] + ba * uv[j, i] + bb * vv[i, j]
