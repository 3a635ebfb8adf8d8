"""Element loops of mid-edge bending over triangles with the hinges around them.

stencils (m, j): the hinges of each element; weights (m, r, j): their entries in its r rows of G; change (h,):
theta - theta0 [rad].
"""

import numpy as np
from numpy.typing import NDArray

from clothsim.base.arrays import Floats, Ints
from clothsim.base.jit import kernel, natural
from clothsim.base.vectors import four_points
from clothsim.geometry.kinematics.hinge_angle import hinge_angle_gradient


@kernel
def value(stencils: Ints, weights: Floats, change: Floats) -> float:
    """|G (theta - theta0)|^2/2 [J]."""
    total = 0.0
    for t in range(len(stencils)):
        for q in range(weights.shape[1]):
            strain = 0.0
            for j in range(stencils.shape[1]):
                strain += weights[t, q, j] * change[natural(stencils[t, j])]
            total += strain * strain
    return 0.5 * total


@kernel
def moments(stencils: Ints, weights: Floats, change: Floats) -> Floats:
    """G'G (theta - theta0), (h,) [N m]."""
    out = np.zeros_like(change)
    for t in range(len(stencils)):
        for q in range(weights.shape[1]):
            strain = 0.0
            for j in range(stencils.shape[1]):
                strain += weights[t, q, j] * change[natural(stencils[t, j])]
            if strain != 0.0:
                for j in range(stencils.shape[1]):
                    out[natural(stencils[t, j])] += weights[t, q, j] * strain
    return out


@kernel
def angle_gradients(vertices: Ints, x: Floats) -> Floats:
    """dtheta/dx of each hinge, (h, 12) [1/m]."""
    slopes = np.empty((len(vertices), 12))
    for h in range(len(vertices)):
        a, b, c, d = four_points(x, vertices, h)
        g = hinge_angle_gradient(a, b, c, d)
        for k in range(4):
            slopes[h, 3 * k], slopes[h, 3 * k + 1], slopes[h, 3 * k + 2] = g[k]
    return slopes


@kernel
def product(vertices: Ints, stencils: Ints, weights: Floats, slopes: Floats, v: Floats) -> Floats:
    """J' G'G J v for v (N, 3), with the rows J = `slopes` (h, 12)."""
    change = np.empty(len(vertices))
    for h in range(len(vertices)):
        turned = 0.0
        for k in range(4):
            row = natural(vertices[h, k])
            for i in range(3):
                turned += slopes[h, 3 * k + i] * v[row, i]
        change[h] = turned
    torques = moments(stencils, weights, change)
    out = np.zeros_like(v)
    for h in range(len(vertices)):
        for k in range(4):
            row = natural(vertices[h, k])
            for i in range(3):
                out[row, i] += torques[h] * slopes[h, 3 * k + i]
    return out


@kernel
def factors(
    vertices: Ints, stencils: Ints, weights: Floats, slots: NDArray[np.int8], n_slots: int, slopes: Floats
) -> Floats:
    """G J, (r m, 3 n_slots): row r t + q is the sum of weight_j dtheta_j/dx over the vertices of element t."""
    r = weights.shape[1]
    out = np.zeros((r * len(stencils), 3 * n_slots))
    for t in range(len(stencils)):
        for j in range(stencils.shape[1]):
            h = natural(stencils[t, j])
            for k in range(4):
                at = natural(3 * slots[t, j, k])
                for i in range(3):
                    for q in range(weights.shape[1]):
                        out[r * t + q, at + i] += weights[t, q, j] * slopes[h, 3 * k + i]
    return out
