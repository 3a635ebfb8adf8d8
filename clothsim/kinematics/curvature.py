"""The curvature of every triangle from the angles of the hinges round it, exact for quadratic surfaces.

On a triangle of area A with edges of lengths l_i and outward normals n_i in the plane, the mean curvature tensor is

    S = sum_i (l_i/A) m_i n_i n_i'

where m_i is the angle by which the surface at the middle of edge i is turned out of the triangle's plane (the Morley
triangle; Grinspun, Gingold, Reisman & Zorin 2006, "Computing discrete shape operators on general meshes"). The two
triangles of a hinge share the direction at its middle: with theta the hinge's angle, m = theta/2 + phi in the first and
theta/2 - phi in the second. phi is an unknown of each edge in Grinspun et al.; phi = 0, the mean of the two normals, is
wrong on irregular meshes. Here phi is recovered: the combination of the five angles in the two triangles with the
smallest coefficients that is right for every quadratic surface. So no unknown is added, the curvature of a quadratic
surface is exact on any mesh, and a deformation whose curvatures vanish is affine: nothing bends for free.

Free borders: m there belongs to one triangle alone and takes the value of least energy, which makes the bending moment
across the border zero. The recovery beside a border uses that too. Clamps: m is the whole angle to the plane that is
held. Everything is linear in the angles and measured at rest: theta is the change of angle since rest.
"""

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from clothsim.arrays import Floats, Ints
from clothsim.mesh.hinges import Hinges
from clothsim.mesh.topology import half_edges
from clothsim.mesh.world import World

ROOT2 = np.sqrt(2)
MOST = 3.0
"""Bound on what one combination of angles may add to phi: eight vertices near one conic do not tell their curvature."""
ONE_BORDER = 0.25
"""Borders whose normals differ by less than about this angle [rad] count as one, smooth: only corners have two."""

FREE, WHOLE, HALF, RIGID = range(4)
"""What the edge of a triangle is: a free border; clamped (m = theta); inside (theta/2 +- phi); held itself (m = 0)."""


@dataclass(frozen=True)
class _Edges:
    """Each edge of each triangle: directions (m, 3) [rad] in the triangle's frame, lengths (m, 3) [m]; areas (m,);
    bends (m, 3, 3): m_i for each curvature, in the frame of the edge; hinges (m, 3), -1 where none; sides (m, 3) of
    the hinge on which the triangle lies; kinds (m, 3). Curvatures are (k_xx, sqrt(2) k_xy, k_yy)."""

    directions: Floats
    lengths: Floats
    areas: Floats
    bends: Floats
    hinges: Ints
    sides: Ints
    kinds: Ints


def bending_strains(world: World, hinges: Hinges) -> sparse.csr_array:
    """The matrix G (3 m, h) that takes changes of angle to bending strains: E = |G theta|^2/2 [sqrt(J)].

    Rows 3 t to 3 t + 2 are triangle t's sqrt(A D) times its curvature, so scaled that their squares add up to
    A D [(1 - nu) |S|^2 + nu tr(S)^2], with D and nu of its fabric. `hinges` may be a part of the world's.
    """
    edges = _edges(world, hinges)
    nu = world.per_triangle("poisson_ratio")
    stiffness = world.per_triangle("bending_stiffness") / edges.areas
    normal = _turn(edges.directions)[..., 2, :]  # n n' of each edge in the triangle's frame
    scale = (np.sqrt(stiffness)[:, None] * edges.lengths)[..., None]
    columns = np.swapaxes(scale * normal @ _root(nu), 1, 2)
    free = np.where((edges.kinds == FREE)[:, None, :], columns, 0.0)
    columns = np.where((edges.kinds == FREE)[:, None, :], 0.0, columns)
    columns -= free @ np.linalg.pinv(free) @ columns
    m = len(columns)
    triangles = sparse.bsr_array((columns, np.arange(m), np.arange(m + 1)), shape=(3 * m, 3 * m))
    strains = (triangles.tocsr() @ _middles(edges, nu, len(hinges.vertices))).tocsr()
    strains.data[np.abs(strains.data) <= 1e-13 * np.abs(strains.data).max(initial=0.0)] = 0.0
    strains.eliminate_zeros()
    return strains


def _edges(world: World, hinges: Hinges) -> _Edges:
    corners = np.concatenate([cloth.material_coordinates for cloth in world.cloths])
    arms = corners[:, [1, 2, 0]] - corners
    twice_area = arms[:, 0, 0] * arms[:, 1, 1] - arms[:, 0, 1] * arms[:, 1, 0]
    arms[..., 1] *= np.sign(twice_area)[:, None]  # a mirrored pattern is turned over
    lengths = np.linalg.norm(arms, axis=2)
    heights = np.abs(twice_area)[:, None] / lengths
    reach = -arms[:, [2, 0, 1]]
    off = np.einsum("tik,tik->ti", reach, arms) / lengths - lengths / 2  # the corner's foot from the edge's middle
    bends = np.stack([(off**2 - lengths**2 / 4) / (2 * heights), off / ROOT2, heights / 2], axis=2)
    directions = np.arctan2(arms[..., 1], arms[..., 0])
    number, sides = _hinges_of(world.triangles, hinges.vertices)
    held = hinges.held[number] if len(hinges.held) else np.full_like(number, -1)
    kinds = np.where(number < 0, FREE, np.where(held < 0, HALF, np.where(held == sides, RIGID, WHOLE)))
    return _Edges(directions, lengths, np.abs(twice_area) / 2, bends, number, sides, kinds)


def _hinges_of(triangles: Ints, hinge_vertices: Ints) -> tuple[Ints, Ints]:
    """The hinge at each edge of each triangle, (m, 3), -1 where none, and 0 where the triangle is its first, else 1."""
    directed, ends = half_edges(triangles), hinge_vertices[:, :2]
    base = 1 + max(int(directed.max(initial=0)), int(ends.max(initial=0)))
    keys, known = (np.sort(pairs, axis=1) @ np.array([base, 1]) for pairs in (directed, ends))
    order = np.argsort(known)
    at = np.searchsorted(known, keys, sorter=order)
    found = np.append(order, -1)[at]
    found = np.where((found >= 0) & (np.append(known, -1)[found] == keys), found, -1)
    sides = (np.append(ends[:, 0], -1)[found] != directed[:, 0]).astype(np.int64)
    return found.reshape(-1, 3), sides.reshape(-1, 3)


def _middles(edges: _Edges, nu: Floats, n_hinges: int) -> sparse.csr_array:
    """The matrix (3 m, h) from changes of angle to the m of each edge of each triangle."""
    hinge, kind = edges.hinges.ravel(), edges.kinds.ravel()
    own = np.flatnonzero((kind == WHOLE) | (kind == HALF))
    shape = (len(hinge), n_hinges)
    share = np.where(kind[own] == WHOLE, 1.0, 0.5)
    half = np.flatnonzero(kind == HALF)
    sign = 1.0 - 2.0 * edges.sides.ravel()[half]
    pick = sparse.csr_array((sign, (half, hinge[half])), shape=shape)
    return sparse.csr_array((share, (own, hinge[own])), shape=shape) + pick @ _recovery(edges, nu, n_hinges)


def _recovery(edges: _Edges, nu: Floats, n_hinges: int) -> sparse.csr_array:
    """The matrix (h, h) from changes of angle to phi, of the hinges between two triangles that both bend.

    With rows a_j the five angles and b the phi of each curvature k: the shortest c with (c A) k = b k for all k, or for
    all that cause no moment across the free borders among the four other edges.
    """
    angle = np.zeros((n_hinges, 3))  # of each curvature, in the frame of the hinge
    inside = edges.kinds == HALF
    np.add.at(angle, edges.hinges[inside], edges.bends[inside])
    sides = [np.zeros((n_hinges, 2), np.int64) for _ in range(2)]
    for side in range(2):
        t, i = np.nonzero(inside & (edges.sides == side))
        sides[side][edges.hinges[t, i]] = np.column_stack([t, i])
    known = np.unique(edges.hinges[inside])
    (t1, i1), (t2, i2) = (sides[side][known].T for side in range(2))
    phi = (edges.bends[t1, i1] - edges.bends[t2, i2]) / 2
    rows, number = [angle[known]], [known]
    bound = []
    for t, i in ((t1, i1), (t2, i2)):
        for j in ((i + 1) % 3, (i + 2) % 3):
            turn = _turn(edges.directions[t, j] - edges.directions[t, i])
            kind = edges.kinds[t, j][:, None]
            seen = np.where(kind == HALF, angle[edges.hinges[t, j]], np.where(kind == WHOLE, edges.bends[t, j], 0.0))
            rows.append(np.einsum("hk,hkl->hl", seen, turn))
            number.append(edges.hinges[t, j])
            moment = np.column_stack([nu[t], 0 * nu[t], 1 + 0 * nu[t]])
            bound.append(np.where(kind == FREE, np.einsum("hk,hkl->hl", moment, turn), 0.0))
    free = np.stack(bound, axis=1)
    possible = np.eye(3) - np.linalg.pinv(free, rcond=ONE_BORDER) @ free
    shares = _shortest(np.stack(rows, axis=1), possible, phi)
    columns = np.stack(number, axis=1)
    used = columns >= 0
    at = np.broadcast_to(known[:, None], columns.shape)[used]
    return sparse.csr_array((shares[used], (at, columns[used])), shape=(n_hinges, n_hinges))


def _shortest(rows: Floats, possible: Floats, phi: Floats) -> Floats:
    """The shortest c (h, j) with (c A) k = b k for all `possible` k, no part of it beyond MOST.

    `rows` A (h, j, 3), `possible` the projections (h, 3, 3) on those k, `phi` b (h, 3).
    """
    U, s, Vt = np.linalg.svd(rows @ possible, full_matrices=False)
    seen = s > 1e-9 * np.linalg.norm(rows, axis=(1, 2))[:, None]
    parts = np.divide(np.einsum("hkm,hml,hl->hk", Vt, possible, phi), s, out=np.zeros_like(s), where=seen)
    return np.einsum("hjk,hk->hj", U, np.clip(parts, -MOST, MOST))


def _turn(angle: Floats) -> Floats:
    """What takes curvatures to those in a frame turned by `angle (...)` [rad], an orthogonal matrix (..., 3, 3)."""
    c, s = np.cos(angle), np.sin(angle)
    rows = [
        [c * c, ROOT2 * c * s, s * s],
        [-ROOT2 * c * s, c * c - s * s, ROOT2 * c * s],
        [s * s, -ROOT2 * c * s, c * c],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def _root(nu: Floats) -> Floats:
    """The symmetric root of (1 - nu) |k|^2 + nu (k_xx + k_yy)^2, (m, 3, 3)."""
    trace = np.outer([1, 0, 1], [1, 0, 1]) / 2
    low, high = np.sqrt(1 - nu)[:, None, None], np.sqrt(1 + nu)[:, None, None]
    return low * np.eye(3) + (high - low) * trace
