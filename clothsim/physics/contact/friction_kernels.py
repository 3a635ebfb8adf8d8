"""Pair loops of lagged friction: E = sum L f0(|u|), u = z + (I - n n') sum_i g_i (x_i - start_i).

L = mu F; z: elastic slip at the start of the step; e: displacement from which a contact slides, eps_v dt or the largest
elastic slip.
"""

import numpy as np

from clothsim.base.jit import inlined, kernel, natural


@inlined
def _sliding(x, start, rows, g, n, z, u):
    """Tangential displacement u (3,) [m] of a pair, with the elastic slip z (3,) at the start; returns its length."""
    for k in range(3):
        u[k] = 0.0
    for i in range(4):
        row = natural(rows[i])
        for k in range(3):
            u[k] += g[i] * (x[row, k] - start[row, k])
    normal_part = norm_squared = 0.0
    for k in range(3):
        normal_part += u[k] * n[k]
    for k in range(3):
        u[k] += z[k] - normal_part * n[k]
        norm_squared += u[k] * u[k]
    return np.sqrt(norm_squared)


@kernel
def value(x, start, elements, weights, normals, limits, slips, e):
    """Sum of L f0 [J]."""
    u = np.empty(3)
    total = 0.0
    for p in range(len(elements)):
        length = _sliding(x, start, elements[p], weights[p], normals[p], slips[p], u)
        total += limits[p] * (length if length >= e else length * length / e - length**3 / (3.0 * e * e) + e / 3.0)
    return total


@inlined
def _per_length(length, e):
    """f0'(y) / y [1/m]: finite at 0."""
    return 1.0 / length if length >= e else (2.0 - length / e) / e


@kernel
def gradient(x, start, elements, weights, normals, limits, slips, e):
    """Sum of L f0'/|u| g_i u, (N, 3) [N]."""
    out = np.zeros_like(x)
    u = np.empty(3)
    for p in range(len(elements)):
        slope = limits[p] * _per_length(_sliding(x, start, elements[p], weights[p], normals[p], slips[p], u), e)
        for i in range(4):
            row = natural(elements[p, i])
            for k in range(3):
                out[row, k] += slope * weights[p, i] * u[k]
    return out


@kernel
def hessian(x, start, elements, weights, normals, limits, slips, e):
    """Blocks (p, 12, 12): L g_i g_j (f0'/|u| (I - n n' - t t') + f0'' t t'), t = u/|u|."""
    blocks = np.empty((len(elements), 12, 12))
    u, block = np.empty(3), np.empty((3, 3))
    for p in range(len(elements)):
        length = _sliding(x, start, elements[p], weights[p], normals[p], slips[p], u)
        tangent_scale = _per_length(length, e)
        normal_part = 0.0 if length >= e else 2.0 * (1.0 - length / e) / e
        for k in range(3):
            for q in range(3):
                block[k, q] = tangent_scale * ((1.0 if k == q else 0.0) - normals[p, k] * normals[p, q])
                if length > 0.0:
                    block[k, q] += (normal_part - tangent_scale) * u[k] * u[q] / (length * length)
        for i in range(4):
            for k in range(3):
                for j in range(4):
                    weight = limits[p] * weights[p, i] * weights[p, j]
                    for q in range(3):
                        blocks[p, 3 * i + k, 3 * j + q] = weight * block[k, q]
    return blocks
