"""The second derivatives of the barrier, from the poses of its pairs (`barrier_kernels.measure`).

Without a mollifier the block of a pair is 4 b'' gg'rr' + 2 b' (gg'I - sum G G'), G = g t + c r (see `distance`), with
b' < 0 < b''. Of its part along gg'rr' what is positive is kept; each tangent t leaves 2|b'| (G G' - gg't t'), which in
the directions g t and c r is |r||g||c| off the diagonal and |r|^2 |c|^2 on it: its positive eigenpair is in closed
form. Tangents along which the closest points do not move have -2|b'| gg't t' alone: none of it is kept. So what is
positive is a sum of at most three squares; that of mollified pairs is found by their eigenvalues.
"""

import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.contact.barrier_kernels import FIRST, LINE, SECOND, SHARE, VALUE, crossing_gradient, edges, mollifier
from clothsim.contact.closest_points import dot
from clothsim.contact.distance import free_directions
from clothsim.contact.psd_projection import positive_squares
from clothsim.contact.relative_coordinates import absolute_block, relative
from clothsim.energies.hessians import ElementHessian, LowRankHessian, room_for
from clothsim.indexing import four_points
from clothsim.jit import kernel, part


def projected(
    poses: Floats, x: Floats, elements: Ints, thresholds: Floats, n_points: int, kappa: float
) -> LowRankHessian:
    """A positive semi-definite Hessian no smaller than the exact one, pair by pair [N/m]."""
    mollified = np.flatnonzero(poses[:, SHARE] < 1.0)
    sides = np.empty((3 * (len(elements) - len(mollified)) + 9 * len(mollified), 12))
    first, count = np.empty((2, len(elements)), np.int64)
    used = squares(sides, first, count, poses, x, elements, n_points, kappa)
    if len(mollified):
        blocks = np.empty((len(mollified), 9, 9))
        relative_blocks(blocks, mollified, poses, x, elements, thresholds, n_points, kappa)
        used = positive_squares(blocks, mollified, sides, used, first, count)
    return LowRankHessian(elements, first, count, sides[:used])


def exact(poses: Floats, x: Floats, elements: Ints, thresholds: Floats, n_points: int, kappa: float) -> ElementHessian:
    """The Hessian as it is [N/m]."""
    blocks = room_for(elements)
    exact_blocks(blocks, poses, x, elements, thresholds, n_points, kappa)
    return ElementHessian(elements, blocks)


@kernel
def squares(sides, first, count, poses, x, elements, n_points, kappa):
    """Fills `sides` (s, 12): those of pair e are count[e] from first[e] on, (p,) each. Returns how many in all.

    Mollified pairs get none.
    """
    at = 0
    for e in range(len(elements)):
        first[e], count[e] = at, 0
        if poses[e, SHARE] < 1.0 or poses[e, FIRST] == 0.0:
            continue
        g, r = _pose(poses, e)
        slope, curvature = kappa * poses[e, FIRST], kappa * poses[e, SECOND]
        (one, t, c), (other, u, d) = free_directions(four_points(x, elements, e), e >= n_points, g)
        _along_normal(sides, at, g, r, slope, curvature)
        at += 1
        if one:
            _along_tangent(sides, at, g, r, t, c, slope)
            at += 1
        if other:
            _along_tangent(sides, at, g, r, u, d, slope)
            at += 1
        count[e] = at - first[e]
    return at


@part
def _pose(poses, e):
    """g and r of a pair."""
    g = poses[e, 0], poses[e, 1], poses[e, 2], poses[e, 3]
    return g, (poses[e, LINE], poses[e, LINE + 1], poses[e, LINE + 2])


@part
def _along_normal(sides, at, g, r, slope, curvature):
    size = np.sqrt(max(4.0 * curvature + 2.0 * slope / dot(r, r), 0.0))
    for i in range(4):
        for p in range(3):
            sides[at, 3 * i + p] = size * g[i] * r[p]


@part
def _along_tangent(sides, at, g, r, t, c, slope):
    """The positive eigenpair of the matrix with |g| z off the diagonal and z^2 on it, z = |r||c|."""
    size = g[0] * g[0] + g[1] * g[1] + g[2] * g[2] + g[3] * g[3]
    z = np.sqrt(dot(r, r) * (c[0] * c[0] + c[1] * c[1] + c[2] * c[2] + c[3] * c[3]))
    root = np.sqrt(z * z + 4.0 * size)
    share = np.sqrt(-2.0 * slope / (z * root))
    tangential, along = share * z, 0.5 * share * (z + root)
    for i in range(4):
        for p in range(3):
            sides[at, 3 * i + p] = tangential * g[i] * t[p] + along * c[i] * r[p]


@kernel
def exact_blocks(blocks, poses, x, elements, thresholds, n_points, kappa):
    """Fills `blocks (p, 12, 12)`."""
    own, sides = np.empty((1, 9, 9)), np.empty((5, 9))
    for e in range(len(elements)):
        _relative_block(own, 0, sides, poses, four_points(x, elements, e), e, e >= n_points, thresholds[e], kappa)
        absolute_block(own, 0, blocks, e)


@kernel
def relative_blocks(blocks, numbers, poses, x, elements, thresholds, n_points, kappa):
    """Fills `blocks (m, 9, 9)` with those of the pairs of these numbers, in the coordinates of `relative`."""
    sides = np.empty((5, 9))
    for k in range(len(numbers)):
        e = numbers[k]
        _relative_block(blocks, k, sides, poses, four_points(x, elements, e), e, e >= n_points, thresholds[e], kappa)


@part
def _relative_block(blocks, at, sides, poses, points, e, is_edges, threshold, kappa):
    """blocks[at] of pair e: m times the above, b' m' (dq dc' + dc dq') and b (m'' dc dc' + m' d2c).

    sides (5, 9) is used up: g r, G of either tangent, dc, and what stands beside dc.
    """
    g, r = _pose(poses, e)
    m, dm, d2m = 1.0, 0.0, 0.0
    if poses[e, SHARE] < 1.0:
        m, dm, d2m = mollifier(poses[e, SHARE], threshold)
    b, slope, curvature = kappa * poses[e, VALUE], kappa * poses[e, FIRST], kappa * poses[e, SECOND]
    (one, t, c), (other, u, d) = free_directions(points, is_edges, g)
    across = -2.0 * m * slope
    _fill_sides(sides, relative(g), r, t, relative(c), u, relative(d))
    _fill_crossing(sides, crossing_gradient(*edges(points)), dm, 2.0 * slope * dm, b * d2m)
    _sum(blocks, at, sides, 4.0 * m * curvature, across * one, across * other, 2.0 * slope * dm)
    _add_all_ways(blocks, at, relative(g), -across)
    if dm > 0.0:
        _add_turning(blocks, at, *edges(points), 4.0 * b * dm)


@part
def _fill_sides(sides, g, r, t, c, u, d):
    for i in range(3):
        for p in range(3):
            sides[0, 3 * i + p] = g[i] * r[p]
            sides[1, 3 * i + p] = g[i] * t[p] + c[i] * r[p]
            sides[2, 3 * i + p] = g[i] * u[p] + d[i] * r[p]


@part
def _fill_crossing(sides, gradient, dm, with_distance, with_itself):
    """dc, 0 without a mollifier. The edges are sqrt 2 times the first two coordinates."""
    du, dv = gradient
    root = np.sqrt(2.0) if dm > 0.0 else 0.0
    for p in range(3):
        sides[3, p], sides[3, 3 + p], sides[3, 6 + p] = root * du[p], root * dv[p], 0.0
    for i in range(9):
        sides[4, i] = with_distance * sides[0, i] + with_itself * sides[3, i]


@part
def _sum(blocks, at, sides, along, across, second, with_distance):
    for i in range(9):
        normal, turning, other = along * sides[0, i], across * sides[1, i], second * sides[2, i]
        crossing, distance = sides[3, i], with_distance * sides[0, i]
        for j in range(9):
            of_distance = normal * sides[0, j] + turning * sides[1, j] + other * sides[2, j]
            blocks[at, i, j] = of_distance + crossing * sides[4, j] + distance * sides[3, j]


@part
def _add_all_ways(blocks, at, g, size):
    for i in range(3):
        for j in range(3):
            for p in range(3):
                blocks[at, 3 * i + p, 3 * j + p] += size * g[i] * g[j]


@part
def _add_turning(blocks, at, u, v, size):
    """d2c/du2 = 2 (|v|^2 I - v v'), d2c/du dv = 2 (2 u v' - v u' - u.v I)."""
    uu, vv, uv = dot(u, u), dot(v, v), dot(u, v)
    for p in range(3):
        for q in range(3):
            same = 1.0 if p == q else 0.0
            blocks[at, p, q] += size * (vv * same - v[p] * v[q])
            blocks[at, 3 + p, 3 + q] += size * (uu * same - u[p] * u[q])
            blocks[at, p, 3 + q] += size * (2.0 * u[p] * v[q] - v[p] * u[q] - uv * same)
            blocks[at, 3 + p, q] += size * (2.0 * v[p] * u[q] - u[p] * v[q] - uv * same)
