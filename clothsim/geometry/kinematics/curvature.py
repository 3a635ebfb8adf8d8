"""Mean curvature tensor of each triangle from the angles of the hinges around it, exact for quadratic surfaces.

On a triangle of area A with edges of lengths l_i and outward normals n_i in the plane, the mean curvature tensor is

    S = sum_i (l_i/A) m_i n_i n_i'

where m_i is the angle between the surface at the middle of edge i and the triangle's plane (the Morley triangle;
Grinspun, Gingold, Reisman & Zorin 2006, "Computing discrete shape operators on general meshes"). The two triangles of a
hinge have the same surface direction at its middle: with theta the hinge's angle, m = theta/2 + phi in the first and
theta/2 - phi in the second. phi is an unknown of each edge in Grinspun et al.; phi = 0, the mean of the two normals, is
wrong on irregular meshes. Here phi is recovered: the combination of the five angles in the two triangles with the
smallest coefficients that is exact for every quadratic surface. So no unknown is added, the curvature of a quadratic
surface is exact on any mesh, and a deformation whose curvatures vanish is affine: there is no zero-energy bending.

Free borders: m there belongs to one triangle alone and takes the value of least energy, which makes the bending moment
across the border zero. The recovery beside a border uses that too. Clamps: m is the whole angle to the clamped plane.
Everything is linear in the angles and relative to the rest shape: theta is the change of angle since rest.

Kirchhoff plate laws are the bending energy per area of the curvature, isotropic or orthotropic. With curvatures
k = (k_11, sqrt(2) k_12, k_22), 1 along the warp, it is k'Ck/2 with

    C = [[D1, 0, D12], [0, T, 0], [D12, 0, D2]],  D12 = nu sqrt(D1 D2)

so that strips cut along warp and weft bend with D1 (1 - nu^2) and D2 (1 - nu^2). D1 = D2 = D with the twisting
stiffness T = (1 - nu) D is the isotropic plate, D/2 [(1 - nu) |S|^2 + nu tr(S)^2] (Timoshenko & Woinowsky-Krieger 1959,
Theory of plates and shells, section 85).

The curvature of a triangle is a mean over it and its neighbours, which loses a wave of wavelength w on cells h: its
energy is 1 - .12 (2 pi h/w)^2 of the true one on equilateral meshes, 1 - .15 (2 pi h/w)^2 on random ones.
`curvature_gradient` has what is lost.
"""

from dataclasses import dataclass
from typing import Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from clothsim.base.arrays import Floats, Ints
from clothsim.geometry.kinematics.deformation_gradient import thread_axes
from clothsim.mesh.cloth import Hinges
from clothsim.mesh.topology import half_edges
from clothsim.mesh.world import World

ROOT2 = np.sqrt(2)
Sides: TypeAlias = tuple[Ints, Ints]
"""Triangles (k,) and the places 0, 1, 2 of an edge in them."""


class PlateLaw(Protocol):
    """C of each triangle over its bending stiffness."""

    def roots(self) -> Floats:
        """The symmetric roots of C in the frames of the triangles, (m, 3, 3)."""

    def border_moments(self, triangles: Ints, directions: Floats) -> Floats:
        """The moments across edges of `directions (k,)` [rad] for each unit curvature in the edges' frames, (k, 3)."""


@dataclass(frozen=True)
class IsotropicPlates:
    """Plates of Poisson's ratios nu (m,)."""

    nu: Floats

    def roots(self) -> Floats:
        """The symmetric root of (1 - nu) |k|^2 + nu (k_xx + k_yy)^2, (m, 3, 3)."""
        trace = np.outer([1, 0, 1], [1, 0, 1]) / 2
        low, high = np.sqrt(1 - self.nu)[:, None, None], np.sqrt(1 + self.nu)[:, None, None]
        return low * np.eye(3) + (high - low) * trace

    def border_moments(self, triangles: Ints, directions: Floats) -> Floats:
        """nu k_tt + k_nn, (k, 3)."""
        nu = self.nu[triangles]
        return np.column_stack([nu, 0 * nu, 1 + 0 * nu])


@dataclass(frozen=True)
class OrthotropicPlates:
    """Plates of matrices C (m, 3, 3) in the frames of their triangles."""

    matrices: Floats

    def roots(self) -> Floats:
        """The symmetric roots, (m, 3, 3)."""
        values, vectors = np.linalg.eigh(self.matrices)
        return np.einsum("mik,mk,mjk->mij", vectors, np.sqrt(np.maximum(values, 0.0)), vectors)

    def border_moments(self, triangles: Ints, directions: Floats) -> Floats:
        """The last row of C in the edge's frame, (k, 3)."""
        turn = rotation_of_curvature(directions)
        return np.einsum("kj,kjl,kil->ki", turn[:, 2], self.matrices[triangles], turn)


def plate_law(world: World, angles: Floats) -> PlateLaw:
    """Law of a world's triangles: orthotropic where a fabric has bending stiffnesses of its own along warp or weft.

    Parameters
    ----------
    world : World
        Cloths with their fabrics, m triangles.
    angles : (m,) array
        Angle from the cloth's first axis to the warp [rad].

    Returns
    -------
    PlateLaw
        Over `Fabric.bending_stiffness`, in the frames of `World.rest_shapes`, mirrored ones reflected back along y.
    """
    nu = world.per_triangle("poisson_ratio")
    if not world.per_triangle("has_own_bending").any():
        return IsotropicPlates(nu)
    names = "bending_along_warp", "bending_along_weft", "twisting_stiffness", "bending_stiffness"
    warp, weft, twist, stiffness = (world.per_triangle(name) for name in names)
    by_threads = matrices_of_threads(warp, twist, weft, nu) / np.where(stiffness > 0, stiffness, 1.0)[:, None, None]
    turn = threads_in_triangles(world, angles)
    return OrthotropicPlates(np.einsum("mki,mkl,mlj->mij", turn, by_threads, turn))


def matrices_of_threads(warp: Floats, twist: Floats, weft: Floats, nu: Floats) -> Floats:
    """The symmetric matrices [[warp, 0, c], [0, twist, 0], [c, 0, weft]], c = nu sqrt(warp weft), (m, 3, 3)."""
    matrices = np.zeros((len(nu), 3, 3))
    matrices[:, 0, 0], matrices[:, 1, 1], matrices[:, 2, 2] = warp, twist, weft
    matrices[:, 0, 2] = matrices[:, 2, 0] = nu * np.sqrt(warp * weft)
    return matrices


def threads_in_triangles(world: World, angles: Floats) -> Floats:
    """Orthogonal matrices (m, 3, 3) from curvatures in the frames of the triangles to those along warp and weft."""
    axis = thread_axes(world, angles)[:, :, 0]
    return rotation_of_curvature(np.arctan2(np.sign(np.linalg.det(world.rest_shapes)) * axis[:, 1], axis[:, 0]))


def rotation_of_curvature(angle: Floats) -> Floats:
    """Orthogonal matrices (..., 3, 3) that express curvatures in a frame rotated by `angle (...)` [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    rows = [
        [c * c, ROOT2 * c * s, s * s],
        [-ROOT2 * c * s, c * c - s * s, ROOT2 * c * s],
        [s * s, -ROOT2 * c * s, c * c],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


MAX_COEFFICIENT = 3.0
"""Bound on each component of a combination of angles: eight vertices near one conic leave their curvature
undetermined."""
SMOOTH_BORDER_ANGLE = 0.25
"""Borders whose normals differ by less than about this angle [rad] count as one, smooth: only corners have two."""

ALIKE = 1e-6
"""Plate laws of two triangles that differ by less, relative to their stiffness, count as one."""

FREE, CLAMPED, INTERIOR, FIXED = range(4)
"""Kinds of a triangle's edge: free border; clamped (m = theta); interior (theta/2 +- phi); fixed itself (m = 0)."""


@dataclass(frozen=True)
class TriangleEdges:
    """Edges of each triangle; curvatures are (k_xx, sqrt(2) k_xy, k_yy).

    directions (m, 3) [rad] in the triangle's frame, lengths (m, 3) [m]; areas (m,) [m2]; middle_angles (m, 3, 3): m_i
    for each unit curvature in the frame of the edge; hinges (m, 3), -1 where none; sides (m, 3): 0 or 1, the triangle's
    side of the hinge; kinds (m, 3).
    """

    directions: Floats
    lengths: Floats
    areas: Floats
    middle_angles: Floats
    hinges: Ints
    sides: Ints
    kinds: Ints


def bending_strains(world: World, hinges: Hinges, angles: Floats | None = None) -> sparse.csr_array:
    """Matrix G from changes of hinge angle to bending strains: E = |G theta|^2/2.

    Rows 3 t to 3 t + 2 are sqrt(A D) times the curvature of triangle t, scaled such that their squares add up to
    A D [(1 - nu) |S|^2 + nu tr(S)^2], with D and nu of its fabric, or to A k'Ck of its orthotropic law (`plate_law`).

    Parameters
    ----------
    world : World
        Cloths with their fabrics, m triangles.
    hinges : Hinges
        The h hinges of the world, or a subset of them.
    angles : (m,) array, optional
        Angle from the cloth's first axis to the warp [rad]; 0 where it is not given.

    Returns
    -------
    (3 m, h) sparse array
        G [sqrt(J)].
    """
    edges = triangle_edges(world, hinges)
    law = plate_law(world, np.zeros(len(world.triangles)) if angles is None else angles)
    stiffness = world.per_triangle("bending_stiffness") / edges.areas
    normal = rotation_of_curvature(edges.directions)[..., 2, :]  # n n' of each edge in the triangle's frame
    scale = (np.sqrt(stiffness)[:, None] * edges.lengths)[..., None]
    columns = np.swapaxes(scale * normal @ law.roots(), 1, 2)
    free = np.where((edges.kinds == FREE)[:, None, :], columns, 0.0)
    columns = np.where((edges.kinds == FREE)[:, None, :], 0.0, columns)
    columns -= free @ np.linalg.pinv(free) @ columns
    m = len(columns)
    triangles = sparse.bsr_array((columns, np.arange(m), np.arange(m + 1)), shape=(3 * m, 3 * m))
    # from changes of angle to the m of each edge of each triangle
    hinge, kind = edges.hinges.ravel(), edges.kinds.ravel()
    covered, half = np.flatnonzero((kind == CLAMPED) | (kind == INTERIOR)), np.flatnonzero(kind == INTERIOR)
    shape = (len(hinge), len(hinges.vertices))
    weight = np.where(kind[covered] == CLAMPED, 1.0, 0.5)
    sign = 1.0 - 2.0 * edges.sides.ravel()[half]
    correction = sparse.csr_array((sign, (half, hinge[half])), shape=shape)
    middle = sparse.csr_array((weight, (covered, hinge[covered])), shape=shape)
    middle = middle + correction @ _recovery(edges, law, len(hinges.vertices))
    strains = (triangles.tocsr() @ middle).tocsr()
    strains.data[np.abs(strains.data) <= 1e-13 * np.abs(strains.data).max(initial=0.0)] = 0.0
    strains.eliminate_zeros()
    return strains


def angles_of_curvature(world: World, hinges: Hinges, curvatures: Floats) -> Floats:
    """Changes of the angles (h,) [rad] of hinges by curvatures of the triangles, (m, 3) [1/m] in their frames."""
    edges = triangle_edges(world, hinges)
    turned = np.einsum("tikl,tl->tik", rotation_of_curvature(edges.directions), curvatures)
    middle = np.einsum("tik,tik->ti", edges.middle_angles, turned)
    bends = (edges.kinds == INTERIOR) | (edges.kinds == CLAMPED)
    angles = np.zeros(len(hinges.vertices))
    np.add.at(angles, edges.hinges[bends], middle[bends])
    return angles


def triangle_edges(world: World, hinges: Hinges) -> TriangleEdges:
    """The edges of all triangles, with the kind that the hinges and clamps give them."""
    corners = np.concatenate([cloth.material_coordinates for cloth in world.cloths])
    arms = corners[:, [1, 2, 0]] - corners
    twice_area = arms[:, 0, 0] * arms[:, 1, 1] - arms[:, 0, 1] * arms[:, 1, 0]
    arms[..., 1] *= np.sign(twice_area)[:, None]  # a mirrored pattern is reflected back
    lengths = np.linalg.norm(arms, axis=2)
    heights = np.abs(twice_area)[:, None] / lengths
    edges_to_corner = -arms[:, [2, 0, 1]]
    # foot of the corner's height, measured from the edge's middle
    foot = np.einsum("tik,tik->ti", edges_to_corner, arms) / lengths - lengths / 2
    middle_angles = np.stack([(foot**2 - lengths**2 / 4) / (2 * heights), foot / ROOT2, heights / 2], axis=2)
    directions = np.arctan2(arms[..., 1], arms[..., 0])
    number, sides = hinges_of_triangles(world.triangles, hinges.vertices)
    held = hinges.held[number] if len(hinges.held) else np.full_like(number, -1)
    kinds = np.where(number < 0, FREE, np.where(held < 0, INTERIOR, np.where(held == sides, FIXED, CLAMPED)))
    return TriangleEdges(directions, lengths, np.abs(twice_area) / 2, middle_angles, number, sides, kinds)


def sides_of_hinges(edges: TriangleEdges, n_hinges: int) -> tuple[Sides, Sides]:
    """Triangle and place (h,) of the edge in it of both sides of each interior hinge; -1 at others."""
    found = np.full((2, 2, n_hinges), -1)
    t, i = np.nonzero(edges.kinds == INTERIOR)
    found[edges.sides[t, i], :, edges.hinges[t, i]] = np.column_stack([t, i])
    return (found[0, 0], found[0, 1]), (found[1, 0], found[1, 1])


def same_law(law: PlateLaw, stiffness: Floats, edges: TriangleEdges, first: Sides, second: Sides) -> NDArray[np.bool_]:
    """True where triangles (k,) and their neighbours over the edges at these places have one plate law."""
    roots = np.sqrt(stiffness)[:, None, None] * law.roots()
    turn1, turn2 = (rotation_of_curvature(edges.directions[side]) for side in (first, second))
    turn = np.einsum("eki,ekj->eij", turn1, turn2)
    apart = roots[first[0]] - np.einsum("eik,ekl,ejl->eij", turn, roots[second[0]], turn)
    largest = np.abs(roots[first[0]]).max(axis=(1, 2), initial=0.0)
    return np.asarray(np.abs(apart).max(axis=(1, 2), initial=0.0) <= ALIKE * largest)


def hinges_of_triangles(triangles: Ints, hinge_vertices: Ints) -> tuple[Ints, Ints]:
    """The hinge at each edge of each triangle, -1 where none; and its side there: 0 where it is the hinge's first."""
    directed, ends = half_edges(triangles), hinge_vertices[:, :2]
    base = 1 + max(int(directed.max(initial=0)), int(ends.max(initial=0)))
    keys, known = (np.sort(pairs, axis=1) @ np.array([base, 1]) for pairs in (directed, ends))
    order = np.argsort(known)
    at = np.searchsorted(known, keys, sorter=order)
    found = np.append(order, -1)[at]
    found = np.where((found >= 0) & (np.append(known, -1)[found] == keys), found, -1)
    sides = (np.append(ends[:, 0], -1)[found] != directed[:, 0]).astype(np.int64)
    return found.reshape(-1, 3), sides.reshape(-1, 3)


def _recovery(edges: TriangleEdges, law: PlateLaw, n_hinges: int) -> sparse.csr_array:
    """The matrix (h, h) from changes of angle to phi, for the interior hinges.

    With rows a_j the five angles and b the phi of each curvature k: the minimum-norm c with (c A) k = b k for all k, or
    for all k without a moment across the free borders among the four other edges.
    """
    angle = np.zeros((n_hinges, 3))  # of each curvature, in the frame of the hinge
    interior = edges.kinds == INTERIOR
    np.add.at(angle, edges.hinges[interior], edges.middle_angles[interior])
    known = np.unique(edges.hinges[interior])
    (t1, i1), (t2, i2) = ((t[known], i[known]) for t, i in sides_of_hinges(edges, n_hinges))
    phi = (edges.middle_angles[t1, i1] - edges.middle_angles[t2, i2]) / 2
    rows, number = [angle[known]], [known]
    moments = []
    for t, i in ((t1, i1), (t2, i2)):
        for j in ((i + 1) % 3, (i + 2) % 3):
            turn = rotation_of_curvature(edges.directions[t, j] - edges.directions[t, i])
            kind = edges.kinds[t, j][:, None]
            clamped = np.where(kind == CLAMPED, edges.middle_angles[t, j], 0.0)
            sampled = np.where(kind == INTERIOR, angle[edges.hinges[t, j]], clamped)
            rows.append(np.einsum("hk,hkl->hl", sampled, turn))
            number.append(edges.hinges[t, j])
            moment = law.border_moments(t, edges.directions[t, j])
            moments.append(np.where(kind == FREE, np.einsum("hk,hkl->hl", moment, turn), 0.0))
    free = np.stack(moments, axis=1)
    admissible = np.eye(3) - np.linalg.pinv(free, rcond=SMOOTH_BORDER_ANGLE) @ free
    stacked = np.stack(rows, axis=1)
    U, s, Vt = np.linalg.svd(stacked @ admissible, full_matrices=False)
    regular = s > 1e-9 * np.linalg.norm(stacked, axis=(1, 2))[:, None]
    components = np.divide(np.einsum("hkm,hml,hl->hk", Vt, admissible, phi), s, out=np.zeros_like(s), where=regular)
    coefficients = np.einsum("hjk,hk->hj", U, np.clip(components, -MAX_COEFFICIENT, MAX_COEFFICIENT))
    columns = np.stack(number, axis=1)
    present = columns >= 0
    at = np.broadcast_to(known[:, None], columns.shape)[present]
    return sparse.csr_array((coefficients[present], (at, columns[present])), shape=(n_hinges, n_hinges))
