"""Curvature at three points of each triangle's patch, with the bending energy that the mean over the patch loses.

Let w be the surface over a triangle's plane, g = (w_xxx, w_xxy, w_xyy, w_yyy) at its centroid. The angles of the nine
hinges around it, its own and the others of its neighbours, give g: the combination with the smallest coefficients that
is exact for every cubic w and 0 for every quadratic one.

The curvature S of `curvature.bending_strains` is exact for quadratic surfaces. Of a wave w = cos(q n.x), n in the
direction a, it has by its response B to the third and T to the fourth derivatives, both known on each mesh,

    S'CS = q^4 k'Ck - q^6 P(a),  P = 2 k'C T g4 - |C^(1/2) B g3|^2   (mean over the phases; the next term is q^8)

with k = (c^2, sqrt(2) c s, s^2), g3 = (c^3, c^2 s, c s^2, s^3), g4 likewise, c = cos a, s = sin a. P is the second
moment along n of the patch over which S is a mean, times k'Ck. So A g'N g/2 with

    g3'N g3 = P(a) for all a

puts back what is lost on every mesh, in every direction, with no constant to choose. Seven conditions on ten entries:
N is the nearest to that of the isotropic patch, m sum_i (d_i k)'C (d_i k), of the same mean. A form that is negative
for no direction is a sum of squares; N's own negative values, and what exceeds MOST_MOMENT, are cut.

Any law of curvature takes it as a mean over three points with a third of the area each, at which the curvature is

    S_q = S + sqrt(2) (cos f_q d1 + sin f_q d2),  f_q = 0, 120, 240 degrees,

as the mean of S_q'CS_q is S'CS + d1'C d1 + d2'C d2. C^(1/2) (d1, d2) = U N^(1/2) g with the 6 x 4 isometry U for which
d1, d2 are nearest to the derivatives of the curvature along the two axes over the patch, m^(1/2) (d_1 k, d_2 k). So a
law that softens, slips or flows sees at each point the curvature that a cubic surface has there.

Beside borders there are fewer hinges, and beside another plate law those across it do not count: parts of g that they
do not determine are 0. There S is as it is without.
"""

import numpy as np
from scipy import sparse

from clothsim.base.arrays import Floats, Ints
from clothsim.geometry.kinematics.curvature import (
    FIXED,
    INTERIOR,
    ROOT2,
    PlateLaw,
    TriangleEdges,
    plate_law,
    same_law,
    sides_of_hinges,
    triangle_edges,
)
from clothsim.mesh.cloth import Hinges
from clothsim.mesh.world import World

DETERMINED = 0.1
"""Least singular value of the angles of cubic surfaces, in the frame of a triangle of area 1, of a part of g that they
determine. Away from borders the least is 0.8 to 1.3 on lattices and 0.5 on random meshes."""
MOST_MOMENT = 2.0
"""Largest second moment of a patch over its triangle's area; it is 0.25 to 0.33 on lattices."""
DIRECTIONS = np.pi * np.arange(12) / 12
"""Directions [rad] in which P is matched: it has harmonics up to 6."""

_COS, _SIN = np.cos(DIRECTIONS), np.sin(DIRECTIONS)
_CURVATURE = np.column_stack([_COS**2, ROOT2 * _COS * _SIN, _SIN**2])
_SIZES = np.sqrt([1.0, 3.0, 3.0, 1.0])
"""g times these has the norm of the tensor of third derivatives."""
_THIRD = np.column_stack([_COS**3, _COS**2 * _SIN, _COS * _SIN**2, _SIN**3])
_FOURTH = np.column_stack([_COS**4, _COS**3 * _SIN, _COS**2 * _SIN**2, _COS * _SIN**3, _SIN**4])
_BY_G = np.zeros((2, 3, 4))
"""Derivatives of the curvature by x and y, of g."""
_BY_G[0, [0, 1, 2], [0, 1, 2]] = _BY_G[1, [0, 1, 2], [1, 2, 3]] = [1.0, ROOT2, 1.0]


_TURNS = 2 * np.pi * np.arange(3) / 3
OFFSETS = np.sqrt(2) * np.stack([np.cos(_TURNS), np.sin(_TURNS)], axis=1)
"""sqrt(2) (cos f_q, sin f_q) of the three points: their mean is 0, and that of their squares the identity."""


def point_strains(
    world: World, hinges: Hinges, strains: sparse.csr_array, angles: Floats | None = None, weight: float = 1.0
) -> tuple[sparse.csr_array, Floats]:
    """Matrix P from changes of hinge angle to the roots of the whole energy, and from those to strains at three points.

    Parameters
    ----------
    world, hinges, angles
        As those of `bending_strains`.
    strains : (3 m, h) sparse array
        G of `bending_strains`.
    weight : float
        Of the lost energy.

    Returns
    -------
    rows : (7 m, h) sparse array
        P [sqrt(J)], E = |P theta|^2/2: the three rows of G of each triangle and four, N^(1/2) g, that vanish for
        constant curvatures.
    points : (m, 9, 7) array
        Isometries from the rows of a triangle to the strains at its three points, three each.
    """
    m = len(world.triangles)
    edges = triangle_edges(world, hinges)
    law = plate_law(world, np.zeros(m) if angles is None else angles)
    stiffness = world.per_triangle("bending_stiffness")
    patch, usable, turn, shift = _patches(hinges, edges, law, stiffness)
    response = _angles_of_polynomials(hinges, patch, turn, shift, np.sqrt(edges.areas))
    listed = strains.tocoo()
    triangle, row = np.divmod(listed.row, 3)
    mean = np.zeros((m, 3, patch.shape[1]))  # the rows of G over the hinges of each patch
    mean[triangle, row, np.argmax(patch[triangle] == listed.col[:, None], axis=1)] = listed.data
    curvature = mean / np.sqrt(np.where(stiffness > 0, stiffness, 1.0))[:, None, None]
    missing, turned = _lost(law.roots(), curvature @ response)
    # from changes of angle to g _SIZES, lengths over sizes
    measured = np.where(usable[..., None], response, 0.0)
    quadratic, cubic = measured[..., :3], measured[..., 3:7] / _SIZES
    free = np.eye(measured.shape[1]) - quadratic @ np.linalg.pinv(quadratic, rcond=1e-9)
    U, s, Vt = np.linalg.svd(free @ cubic, full_matrices=False)
    inverse = np.divide(1.0, s, out=np.zeros_like(s), where=s > DETERMINED)
    recovery = np.einsum("mka,mk,mik->mai", Vt, inverse, U) @ free
    lost = np.sqrt(weight * stiffness)[:, None, None] * (missing @ recovery)
    rows = np.concatenate([mean, lost], axis=1)
    points = np.empty((m, 3, 3, 7))
    points[..., :3] = np.eye(3)
    points[..., 3:] = np.einsum("qa,maik->mqik", OFFSETS, turned.reshape(m, 2, 3, 4))
    present = np.broadcast_to((patch >= 0)[:, None, :], rows.shape) & (rows != 0)
    columns = np.broadcast_to(patch[:, None, :], rows.shape)[present]
    numbers = np.nonzero(present.reshape(7 * m, -1))[0]
    matrix = sparse.csr_array((rows[present], (numbers, columns)), (7 * m, strains.shape[1]))
    return matrix, points.reshape(m, 9, 7) / np.sqrt(len(OFFSETS))


def _patches(
    hinges: Hinges, edges: TriangleEdges, law: PlateLaw, stiffness: Floats
) -> tuple[Ints, np.ndarray, np.ndarray, np.ndarray]:
    """Hinges (m, 9) around each triangle, -1 where none, and z -> turn z + shift from their frames to the triangle's.

    Points of a plane are complex numbers; a triangle has its centroid at 0. Usable (m, 9): those between triangles of
    one plate law, and seen across such.
    """
    along = np.exp(1j * edges.directions)
    steps = edges.lengths * along
    corners = np.cumsum(steps, axis=1) - steps
    corners -= corners.mean(axis=1, keepdims=True)
    own, sides = np.where(edges.kinds == FIXED, -1, edges.hinges), edges.sides
    turn = np.where(sides == 0, along, -along)
    shift = corners + steps / 2 - turn * hinges.edge_lengths[edges.hinges] / 2
    found = sides_of_hinges(edges, len(hinges.vertices))
    inside = found[0][0] >= 0
    same = np.zeros(len(inside), bool)
    same[inside] = same_law(law, stiffness, edges, *((t[inside], i[inside]) for t, i in found))
    crossed = edges.kinds == INTERIOR
    beyond, across = (
        np.where(crossed, np.where(sides == 0, found[1][k][edges.hinges], found[0][k][edges.hinges]), -1)
        for k in (0, 1)
    )
    patch, usable = [own], [(own >= 0) & (~crossed | same[edges.hinges])]
    turns, shifts = [turn], [shift]
    there = beyond >= 0
    for step in (1, 2):
        other = (across + step) % 3
        back = turn / turn[beyond, across]
        patch.append(np.where(there, own[beyond, other], -1))
        usable.append(there & same[edges.hinges] & usable[0][beyond, other])
        turns.append(back * turn[beyond, other])
        shifts.append(back * (shift[beyond, other] - shift[beyond, across]) + shift)
    points = np.concatenate(turns, axis=1), np.concatenate(shifts, axis=1)
    return np.concatenate(patch, axis=1), np.concatenate(usable, axis=1), *points


def _angles_of_polynomials(hinges: Hinges, patch: Ints, turn: np.ndarray, shift: np.ndarray, sizes: Floats) -> Floats:
    """Changes of angle (m, 9, 12) for unit second (3), third (4) and fourth (5) derivatives, over sizes (m,) [m].

    In the triangle's frame, lengths over `sizes`. At a clamp the surface leaves the middle of the edge in its own
    direction, as the other triangle would.
    """
    held = np.where(patch >= 0, hinges.held[patch] if len(hinges.held) else -1, -1)
    local = hinges.corners[patch]
    points = (local[..., 0] + 1j * local[..., 1]) * turn[..., None] + shift[..., None]
    points = np.concatenate([points, points[..., :2].mean(axis=2, keepdims=True)], axis=2) / sizes[:, None, None]
    # x^j y^k / (j! k!) of degrees 2, 3, 4: each has one derivative of its degree, 1
    (x, y), values = _powers(points), np.empty((*points.shape, len(_DEGREES)))
    for i, (j, k, _) in enumerate(_DEGREES):
        np.multiply(x[j], y[k], out=values[..., i])
    over = local[..., 2:, 0] / local[..., 1:2, 0]
    foot = values[..., 0:1, :] + over[..., None] * (values[..., 1:2, :] - values[..., 0:1, :])
    slopes = (values[..., 2:4, :] - foot) / (local[..., 2:, 1] / sizes[:, None, None])[..., None]
    turned = np.where((patch >= 0)[..., None], slopes[..., 0, :] - slopes[..., 1, :], 0.0)
    for side, sign in ((0, 1.0), (1, -1.0)):
        rows = np.nonzero(held == side)
        direction = 1j * turn[rows]
        (x, y), beside = _powers(points[..., 4][rows]), np.zeros((len(rows[0]), len(_DEGREES)))
        for i, (j, k, _) in enumerate(_DEGREES):
            if j:
                beside[:, i] += direction.real * x[j - 1] * y[k]
            if k:
                beside[:, i] += direction.imag * x[j] * y[k - 1]
        turned[rows] = sign * (beside - slopes[..., 1 - side, :][rows])
    return turned


_DEGREES = [(k, n - k, n) for n in (2, 3, 4) for k in range(n, -1, -1)]


def _powers(z: np.ndarray) -> tuple[list[Floats], list[Floats]]:
    """x^n/n! and y^n/n!, n 0 to 4, of z = x + i y."""
    powers = []
    for part in (z.real, z.imag):
        of_part = [np.ones_like(part)]
        for n in range(1, 5):
            of_part.append(of_part[-1] * part / n)
        powers.append(of_part)
    return powers[0], powers[1]


def _lost(roots: Floats, response: Floats) -> tuple[Floats, Floats]:
    """Symmetric roots (m, 4, 4) of N over the area and U (m, 6, 4), of C^(1/2) S for unit derivatives (m, 3, 12)."""
    plate = _CURVATURE @ roots
    third, fourth = response[..., 3:7] @ _THIRD.T, response[..., 7:] @ _FOURTH.T
    lost = 2 * np.einsum("mpi,mip->mp", plate, fourth) - (third**2).sum(axis=1)
    whole = (plate**2).sum(axis=2).mean(axis=1)
    derivatives = np.einsum("mij,kja->mkia", roots, _BY_G / _SIZES).reshape(-1, 6, 4)
    isotropic = np.einsum("mia,mib->mab", derivatives, derivatives)
    moments = np.divide(lost.mean(axis=1), whole, out=np.zeros_like(whole), where=whole > 0)  # 0 of limp triangles
    isotropic *= moments[:, None, None]
    waves = _THIRD * _SIZES
    products = (waves[:, :, None] * waves[:, None, :]).reshape(len(waves), 16)
    remains = lost - isotropic.reshape(-1, 16) @ products.T
    forms = isotropic + (remains @ np.linalg.pinv(products, rcond=1e-9).T).reshape(-1, 4, 4)
    values, vectors = np.linalg.eigh(forms)
    values = np.clip(values, 0.0, MOST_MOMENT * whole[:, None])
    root = np.einsum("mik,mk,mjk->mij", vectors, np.sqrt(values), vectors)
    left, _, right = np.linalg.svd(derivatives @ root, full_matrices=False)
    return root, left @ right
