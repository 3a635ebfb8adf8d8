"""Element loops over hinges: angles, moments about them, and mid-edge bending of the triangles between them.

vertices (h, 4): a, b, c, d of `kinematics.hinge_angle`; moments M (h,) [N m], 0 where a hinge has no angle.

Mid-edge bending loops over triangles with the hinges around them: stencils (m, j): the hinges of each element; weights
(m, r, j): their entries in its r rows of G; change (h,): theta - theta0 [rad].
"""

import numpy as np
from numpy.typing import NDArray

from clothsim.base.arrays import Floats, Ints
from clothsim.base.jit import LANES, inlined, kernel, natural
from clothsim.base.vectors import four_points
from clothsim.geometry.kinematics.hinge_angle import (
    hinge_angle_gradient,
    hinge_blocks,
    hinge_direction,
    hinge_squares,
)
from clothsim.physics.energies.block_sums import add_lanes
from clothsim.physics.energies.hessians import LanesHessian, point, write


@kernel
def angles(vertices: Ints, x: Floats) -> Floats:
    """The angle of each hinge, (h,) [rad]; +inf where a triangle has no area."""
    hinge_angles, points, turned = np.empty(len(vertices)), np.zeros(12 * LANES), np.zeros(3 * LANES)
    for first in range(0, len(vertices), LANES):
        _gather(points, vertices, x, first)
        for lane in range(LANES):
            a, b, c, d = point(points, 0, lane), point(points, 3, lane), point(points, 6, lane), point(points, 9, lane)
            sine, cosine, whole = hinge_direction(a, b, c, d)
            turned[lane], turned[LANES + lane], turned[2 * LANES + lane] = sine, cosine, 1.0 if whole else 0.0
        for lane in range(min(LANES, len(vertices) - first)):
            angle = np.arctan2(turned[lane], turned[LANES + lane])
            hinge_angles[first + lane] = angle if turned[2 * LANES + lane] > 0.0 else np.inf
    return hinge_angles


@kernel
def gradient(vertices: Ints, moments: Floats, x: Floats) -> Floats:
    """sum M dtheta/dx, (N, 3) [N]."""
    out = np.zeros_like(x)
    for h in range(len(vertices)):
        if moments[h] != 0.0:  # skips most hinges of a flat sheet
            a, b, c, d = four_points(x, vertices, h)
            g = hinge_angle_gradient(a, b, c, d)
            for k in range(4):
                row = natural(vertices[h, k])
                for i in range(3):
                    out[row, i] += moments[h] * g[k][i]
    return out


def hinge_hessian(vertices: Ints, moments: Floats, stiffnesses: Floats, x: Floats) -> LanesHessian:
    """Return sum M d2theta/dx2 + k g g', g = dtheta/dx, with k = `stiffnesses` (h,) [N m]."""
    given = vertices, moments, stiffnesses, x
    return LanesHessian(
        vertices, lambda lanes, first: fill(lanes, first, *given), lambda data, at: add_hinges(data, at, *given)
    )


@kernel
def fill(lanes: Floats, first: int, vertices: Ints, moments: Floats, stiffnesses: Floats, x: Floats) -> None:
    """`LanesHessian.fill` of `hinge_hessian`."""
    points, factors = np.zeros(12 * LANES), np.zeros(2 * LANES)
    for group in range(len(lanes)):
        _fill_group(lanes[group], first + group * LANES, points, factors, vertices, moments, stiffnesses, x)


@kernel
def add_hinges(data: Floats, at: Ints, vertices: Ints, moments: Floats, stiffnesses: Floats, x: Floats) -> int:
    """`LanesHessian.add` of `hinge_hessian`."""
    points, factors, lanes = np.zeros(12 * LANES), np.zeros(2 * LANES), np.empty(90 * LANES)
    outside = 0
    for first in range(0, len(vertices), LANES):
        _fill_group(lanes, first, points, factors, vertices, moments, stiffnesses, x)
        outside += add_lanes(data, at, first, lanes)
    return outside


@inlined
def _fill_group(out, begin, points, factors, vertices, moments, stiffnesses, x):
    """Fill a group of lanes; points (12 LANES,) and factors (2 LANES,) are overwritten."""
    _gather(points, vertices, x, begin)
    without_moments = True
    for lane in range(min(LANES, len(vertices) - begin)):
        factors[lane], factors[LANES + lane] = moments[begin + lane], stiffnesses[begin + lane]
        without_moments &= factors[lane] == 0.0
    if without_moments:
        for lane in range(LANES):
            a, b, c, d = point(points, 0, lane), point(points, 3, lane), point(points, 6, lane), point(points, 9, lane)
            _write_blocks(out, lane, hinge_squares(a, b, c, d, factors[LANES + lane]))
    else:
        for lane in range(LANES):
            a, b, c, d = point(points, 0, lane), point(points, 3, lane), point(points, 6, lane), point(points, 9, lane)
            _write_blocks(out, lane, hinge_blocks(a, b, c, d, factors[lane], factors[LANES + lane]))


@inlined
def _write_blocks(out, lane, blocks):
    """Write the ten blocks of a hinge."""
    aa, ab, ac, ad, bb, bc, bd, cc, cd, dd = blocks
    write(out, 0, lane, aa)
    write(out, 1, lane, ab)
    write(out, 2, lane, ac)
    write(out, 3, lane, ad)
    write(out, 4, lane, bb)
    write(out, 5, lane, bc)
    write(out, 6, lane, bd)
    write(out, 7, lane, cc)
    write(out, 8, lane, cd)
    write(out, 9, lane, dd)


@inlined
def _gather(points, vertices, x, first):
    """Gather the points of a group of hinges into lanes; a lane without a hinge is left as it is."""
    for lane in range(min(LANES, len(vertices) - first)):
        a, b, c, d = four_points(x, vertices, first + lane)
        for k in range(3):
            points[k * LANES + lane], points[(3 + k) * LANES + lane] = a[k], b[k]
            points[(6 + k) * LANES + lane], points[(9 + k) * LANES + lane] = c[k], d[k]


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
