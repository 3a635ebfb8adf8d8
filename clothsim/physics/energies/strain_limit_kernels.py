"""Element loops of the strain limit: stretches, and gradient and Hessian by principal stretches.

[u v] = F [a b] as in `fibre_kernels`: the principal stretches of F are those of [u v].
"""

import numpy as np

from clothsim.base.jit import LANES, kernel, natural
from clothsim.physics.energies.triangle_kernels import (
    VALUES_PER_LANE,
    deformation_gradient,
    fill_lanes,
    principal_state,
    products,
    store_lane,
)

ALIKE = 1e-5
"""Difference of two stretches below which a divided difference is replaced by the curvature at their mean."""


@kernel
def stretches(x, triangles, inverses):
    """Principal stretches s1 >= s2, then the warp's la and the weft's lb, (m, 4)."""
    out = np.empty((len(triangles), 4))
    F = np.empty((3, 2))
    for t in range(len(triangles)):
        deformation_gradient(x, triangles[t], inverses[t], F)
        uu, uv, vv = products(F)
        middle, radius = 0.5 * (uu + vv), np.hypot(0.5 * (uu - vv), uv)
        s1 = np.sqrt(middle + radius)
        out[t, 0], out[t, 1] = s1, (np.sqrt(max(uu * vv - uv * uv, 0.0)) / s1 if s1 > 0.0 else 0.0)
        out[t, 2], out[t, 3] = np.sqrt(uu), np.sqrt(vv)
    return out


@kernel
def principal_gradient(x, triangles, inverses, slopes):
    """dE/dx from slopes (m, 2) = dE/ds_i: the stress p1 w1 v1' + p2 w2 v2'."""
    out = np.zeros_like(x)
    F, n, V, W = np.empty((3, 2)), np.empty(3), np.empty((2, 2)), np.empty((2, 3))
    alpha, beta = np.empty(3), np.empty(3)
    for t in range(len(triangles)):
        principal_state(x, triangles[t], inverses[t], F, n, V, W, alpha, beta)
        for p in range(3):
            row = natural(triangles[t, p])
            for k in range(3):
                out[row, k] += slopes[t, 0] * alpha[p] * W[0, k] + slopes[t, 1] * beta[p] * W[1, k]
    return out


@kernel
def fill(lanes, first, x, triangles, inverses, slopes, curvatures, between):
    """`LanesHessian.fill` of d2E/dx2 of E = sum e(s1) + e(s2); between (m,): e'' half-way from s2 to s1.

    The modes of `membrane_kernels.fill`: e'' on the stretches, (e1' + e2')/(s1 + s2) twist, (e1' - e2')/(s1 - s2)
    flip, e_i'/s_i out of plane. None is negative where e grows and is convex.
    """
    F, n, V, W = np.empty((3, 2)), np.empty(3), np.empty((2, 2)), np.empty((2, 3))
    alpha, beta, lane_values = np.empty(3), np.empty(3), np.zeros(VALUES_PER_LANE * LANES)
    for group in range(len(lanes)):
        for lane in range(min(LANES, len(triangles) - first - group * LANES)):
            t = first + group * LANES + lane
            s1, s2 = principal_state(x, triangles[t], inverses[t], F, n, V, W, alpha, beta)
            p1, p2 = slopes[t]
            flip = (p1 - p2) / (s1 - s2) if s1 - s2 > ALIKE else between[t]
            others = (p1 + p2) / (s1 + s2), flip, p1 / s1, p2 / s2
            store_lane(lane_values, lane, 1.0, alpha, beta, W, n, (curvatures[t, 0], 0.0, curvatures[t, 1]), others)
        fill_lanes(lanes[group], lane_values)
