"""Displacement targets of one round of untangling: of edges through the triangles that they pierce.

Contours that end inside both surfaces, where no region tells inside from outside (two hems that interlock), follow the
gradient of their length (Volino & Magnenat-Thalmann 2006, "Resolving surface collisions through intersection contour
minimization", section 3).
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_array, csr_array, diags_array
from scipy.sparse.linalg import splu

from clothsim.base.arrays import Floats, Ints
from clothsim.base.linalg import unit
from clothsim.base.triangles import area_vectors, vertex_area_vectors
from clothsim.geometry.kinematics.deformation_gradient import deformation_gradients
from clothsim.geometry.untangling.contours import (
    Contours,
    EdgeTriangleIntersections,
    FilledMesh,
    Flags,
    contours,
    edge_triangle_intersections,
    inner_ends,
)
from clothsim.mesh.topology import half_edges

# Smallest motion of a sheet that meets displacement targets: one global step of projective dynamics.
#
#     min over d:  1/2 sum_t A_t |grad d - (P_t - F_t)|^2 + alpha/2 |d|^2 + kappa/2 sum_c |sum_j w_cj d_j - s_c|^2
#
# P_t is F_t with its principal stretches clipped to limits (Bouaziz et al. 2014): the sheet resists strain beyond those
# alone, its displacement is smooth, and decays away from the targets.


LIMITS, WIDEST = (0.6, 1.3), (0.3, 2.0)
"""Principal stretches that are not resisted, and how far those of the start widen them."""
KAPPA = 30.0
"""Weight of the targets over the mean diagonal of the Laplacian."""
SLACK = 1e-6
"""Stretches that far beyond their limits are not resisted: round-off."""
RINGS = 3
"""Vertices farther than that many times `spread` from a target, or from a strained triangle, stay."""
LEAST_SPREAD = 3.0
"""Least `spread`."""


@dataclass(frozen=True)
class DisplacementTargets:
    """Displacements s (c, 3) [m] that sums of w x, over rows (c, j) with weights (c, j), are to make.

    spread: edges over which the displacement decays.
    """

    rows: Ints
    weights: Floats
    shifts: Floats
    spread: float = LEAST_SPREAD


NO_TARGETS = DisplacementTargets(np.zeros((0, 1), np.int64), np.zeros((0, 1)), np.zeros((0, 3)))


class SheetOperators:
    """Rest shape of the sheet: its Laplacian and gradients.

    x (n, 3) [m]: start; material (m, 3, 2) [m]: corners of each triangle at rest; fixed (n,) bool: vertices that do not
    move; limits: principal stretches that are not resisted; None: LIMITS, widened to those of the start.
    """

    def __init__(
        self, x: Floats, triangles: Ints, material: Floats, fixed: np.ndarray, limits: tuple[float, float] | None = None
    ) -> None:
        self.triangles, self.fixed, n = triangles, fixed, len(fixed)
        shapes = np.stack([material[:, 1] - material[:, 0], material[:, 2] - material[:, 0]], axis=2)
        self.inverses = np.linalg.inv(shapes)
        self.areas = 0.5 * np.abs(np.linalg.det(shapes))
        self.gradients = np.concatenate([-self.inverses.sum(axis=1, keepdims=True), self.inverses], axis=1)
        blocks = self.areas[:, None, None] * (self.gradients @ self.gradients.transpose(0, 2, 1))
        i, j = np.repeat(triangles, 3, axis=1), np.tile(triangles, 3)
        self.laplacian = csr_array((blocks.ravel(), (i.ravel(), j.ravel())), shape=(n, n))
        self.adjacency = csr_array((np.ones(i.size), (i.ravel(), j.ravel())), shape=(n, n))
        self.unit = float(self.laplacian.diagonal().mean())
        least, most = self.stretches(x)
        self.lower: Floats = np.clip(least, WIDEST[0], LIMITS[0])
        self.upper: Floats = np.clip(most, LIMITS[1], WIDEST[1])
        if limits is not None:
            self.lower, self.upper = (np.full(len(triangles), limit) for limit in limits)

    def stretches(self, x: Floats) -> tuple[Floats, Floats]:
        """Return the principal stretches of each triangle, (m,) and (m,): the smaller, the larger."""
        F = deformation_gradients(x, self.triangles, self.inverses)
        C = F.transpose(0, 2, 1) @ F
        middle, half = 0.5 * (C[:, 0, 0] + C[:, 1, 1]), np.hypot(0.5 * (C[:, 0, 0] - C[:, 1, 1]), C[:, 0, 1])
        return np.sqrt(np.maximum(middle - half, 0.0)), np.sqrt(middle + half)

    def strain_forces(self, x: Floats) -> tuple[Floats, Ints]:
        """Return the forces (n, 3) that draw triangles back into their limits, and those triangles."""
        least, most = self.stretches(x)
        strained = np.flatnonzero((least < self.lower - SLACK) | (most > self.upper + SLACK))
        F = deformation_gradients(x, self.triangles[strained], self.inverses[strained])
        U, stretch, V = np.linalg.svd(F, full_matrices=False)
        bounded = np.clip(stretch, self.lower[strained, None], self.upper[strained, None])
        change = U @ ((bounded - stretch)[:, :, None] * V)
        parts = self.areas[strained, None, None] * (change @ self.gradients[strained].transpose(0, 2, 1))
        forces = np.zeros_like(x)
        np.add.at(forces, self.triangles[strained], parts.transpose(0, 2, 1))
        return forces, strained

    def displacement(self, x: Floats, targets: DisplacementTargets) -> Floats:
        """Return d (n, 3) [m]."""
        forces, strained = self.strain_forces(x)
        n, c = len(x), len(targets.rows)
        here = np.zeros(n, bool)
        here[targets.rows[targets.weights != 0]] = True
        here[self.triangles[strained]] = True
        near = here.astype(np.float64)
        for _ in range(int(RINGS * targets.spread)):
            near = (self.adjacency @ near > 0).astype(np.float64)
        free = np.flatnonzero((near > 0) & ~self.fixed)
        if not len(free):
            return np.zeros_like(x)
        cells = (np.repeat(np.arange(c), targets.rows.shape[1]), targets.rows.ravel())
        W = csr_array((targets.weights.ravel(), cells), shape=(c, n))[:, free]
        kappa = KAPPA * self.unit
        matrix = (
            self.laplacian[free][:, free]
            + diags_array(np.full(len(free), self.unit / targets.spread**2))
            + kappa * W.T @ W
        )
        load = forces[free] + kappa * (W.T @ targets.shifts)
        options = {"SymmetricMode": True}
        solver = splu(csc_array(matrix), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
        moved = np.zeros_like(x)
        moved[free] = solver.solve(load)
        return moved


FLAT = 0.1
"""Least |cosine| of edge and normal that is divided by."""
LEAST = 0.5
"""Least length of the sum of the gradients of a contour that gives its direction."""


def contour_gradients(x: Floats, triangles: Ints, pairs: Ints, found: EdgeTriangleIntersections) -> Floats:
    """Return the motion of each edge, relative to the triangle that it pierces, which shortens the contour fastest.

    Returns
    -------
    (k, 3) float64
        G = sum_i (R_i - 2 (E.R_i)/(E.N) N) over the triangles i beside the edge: E its unit vector, N the normal of the
        triangle that is pierced, R_i the direction of the contour into triangle i.
    """
    intersection, pair, role = found.of_pair.T
    edge = x[found.edges[:, 1]] - x[found.edges[:, 0]]
    edge /= np.linalg.norm(edge, axis=1, keepdims=True)
    owner = triangles[pairs[pair, role]]
    corners = x[owner]
    N, E = found.normals[intersection], edge[intersection]
    R = np.cross(N, area_vectors(corners))
    opposite = owner.sum(axis=1) - found.edges[intersection].sum(axis=1)
    inward = x[opposite] - x[found.edges[intersection, 0]]
    inward -= np.einsum("ij,ij->i", inward, E)[:, None] * E
    R *= np.sign(np.einsum("ij,ij->i", R, inward))[:, None]
    size = np.linalg.norm(R, axis=1, keepdims=True)
    R /= np.where(size > 0, size, 1.0)
    cosine = np.einsum("ij,ij->i", E, N)
    cosine = np.where(cosine < 0, -1.0, 1.0) * np.maximum(np.abs(cosine), FLAT)
    G = np.zeros((len(found.edges), 3))
    np.add.at(G, intersection, R - (2 * np.einsum("ij,ij->i", E, R) / cosine)[:, None] * N)
    # where an intersection is on an edge of the other surface too, round-off may leave out one of its two segments
    n = int(triangles.max(initial=0)) + 1
    ends = np.sort(half_edges(triangles), axis=1)
    keys, count = np.unique(ends[:, 0] * n + ends[:, 1], return_counts=True)
    beside = count[np.searchsorted(keys, found.edges[:, 0] * n + found.edges[:, 1])]
    return G * (np.bincount(intersection, minlength=len(G)) == beside)[:, None]


def slides(G: Floats, graph: Contours) -> Floats:
    """Return directions (k, 3), |.| <= 1, in which each edge slides along its contour, the same for a whole contour.

    A contour that ends inside both surfaces runs from the border of one to that of the other: the gradients of both
    ends, of one surface relative to the other, are alike, and the surfaces slide apart along their sum. Where they
    cancel, or one curve is on both sides, each edge follows its own gradient.
    """
    lower = np.minimum(graph.edge_curve, graph.face_curve)
    sign = np.where(graph.edge_curve == lower, 1.0, -1.0)
    total = np.zeros((graph.n_contours, 3))
    np.add.at(total, graph.contour, sign[:, None] * G)
    size = np.linalg.norm(total, axis=1, keepdims=True)
    whole = sign[:, None] * (total / np.where(size > 0, size, 1.0))[graph.contour]
    own = G / np.maximum(np.linalg.norm(G, axis=1, keepdims=True), 1.0)
    alone = (graph.edge_curve == graph.face_curve) | (size[graph.contour, 0] < LEAST)
    return np.where(alone[:, None], own, whole)


SPREAD = 0.7
"""Edges by which the motion spreads farther, over the square root of the number of vertices inside and of targets."""
COPLANAR = 0.99
"""Cosine of the angle of two planes above which triangles count as coplanar."""
JITTER = 1e-4
"""Random displacement, over the longest target, that takes vertices off the planes of triangles that they lie in."""
Part = tuple[Ints, Floats, Floats]


def displacement_targets(
    x: Floats,
    mesh: FilledMesh,
    solid: Ints,
    pairs: tuple[Ints, Ints],
    inside_before: Flags,
    layers: Ints | None,
    gap: float,
    step: float,
) -> tuple[DisplacementTargets, Flags]:
    """Displacement targets for the pairs of cloth (p, 2), and of cloth and body (q, 2); and what is inside.

    gap: distance beyond a triangle to which what pierced it is drawn [m]; step: longest displacement [m].
    """
    (own, with_body), inside, n = pairs, np.zeros(len(mesh.areas), bool), len(mesh.areas)
    parts: list[Part] = []
    if len(own):
        parts, inside = _cloth_targets(x, mesh, own, inside_before, layers, gap, step)
    if len(with_body):
        parts += _body_targets(x, mesh.triangles, solid, with_body, gap, step, n)
    rows, weights, shifts = (np.concatenate([part[k] for part in parts]) for k in range(3))
    held = rows >= n
    spread = LEAST_SPREAD + SPREAD * np.sqrt(np.count_nonzero(inside) + len(rows))
    return DisplacementTargets(np.where(held, 0, rows), np.where(held, 0.0, weights), shifts, float(spread)), inside


def _cloth_targets(
    x: Floats, mesh: FilledMesh, own: Ints, inside_before: Flags, layers: Ints | None, gap: float, step: float
) -> tuple[list[Part], Flags]:
    """Targets for the contours of cloth with cloth, and the vertices inside."""
    # a vertex that lies in a triangle, or an edge in its plane, is on neither side: pairs that are not coplanar jitter
    corners = x[mesh.triangles[own]]
    normals = np.cross(corners[:, :, 1] - corners[:, :, 0], corners[:, :, 2] - corners[:, :, 0])
    cosine = np.abs(np.einsum("ij,ij->i", normals[:, 0], normals[:, 1]))
    steep = cosine < COPLANAR * np.linalg.norm(normals, axis=2).prod(axis=1)
    vertices = np.unique(mesh.triangles[own[steep]])
    x = x.copy()
    x[vertices] += JITTER * step * np.random.default_rng(0).standard_normal((len(vertices), 3))
    found = edge_triangle_intersections(x, mesh.triangles, own)
    graph = contours(found, len(own))
    chosen = inner_ends(mesh, found, graph, inside_before)
    inner, is_open = chosen.inner.copy(), chosen.is_open.copy()
    if layers is not None:
        below, above = layers[found.edges[:, 0]], layers[mesh.triangles[found.faces, 0]]
        ordered = below != above
        first_is_lower = found.depths[:, 0] < found.depths[:, 1]
        outer_edge = below > above
        inner = np.where(ordered, np.where(first_is_lower == outer_edge, 0, 1), inner)
        is_open &= ~ordered
    parts = [_pull_through(mesh.triangles, found, inner, gap, step)]
    if is_open.any():
        shifts = step * slides(contour_gradients(x, mesh.triangles, own, found), graph)[is_open]
        edges, faces = found.edges[is_open], mesh.triangles[found.faces[is_open]]
        along, at = found.along[is_open, None], found.barycentric[is_open]
        parts.append((np.column_stack([edges, faces]), np.column_stack([1 - along, along, -at]), shifts))
    pierced = np.zeros(len(own), bool)
    pierced[found.of_pair[:, 1]] = True
    parts.append(_part_touching(x, mesh, own[~pierced], gap))
    return parts, chosen.inside


def _pull_through(triangles: Ints, found: EdgeTriangleIntersections, inner: Ints, gap: float, step: float) -> Part:
    """The inner ends of edges go to the side of the outer ones of the triangles that they pierce, and `gap` beyond."""
    rows = np.flatnonzero(inner >= 0)
    end = inner[rows]
    vertices = found.edges[rows, end]
    depth, outer = found.depths[rows, end], found.depths[rows, 1 - end]
    sign = np.where(outer >= depth, 1.0, -1.0)
    shifts = (np.minimum(np.abs(depth) + gap, step) * sign)[:, None] * found.normals[rows]
    corners = triangles[found.faces[rows]]
    doubled = np.column_stack([vertices, vertices, corners])
    return doubled, np.column_stack([np.ones(len(rows)), np.zeros(len(rows)), -found.barycentric[rows]]), shifts


def _part_touching(x: Floats, mesh: FilledMesh, pairs: Ints, gap: float) -> Part:
    """Pairs without an intersection, coplanar or folded onto one another: their corners part along the mean normal."""
    one, other = mesh.triangles[pairs[:, 0]], mesh.triangles[pairs[:, 1]]
    normal = [area_vectors(x[t]) for t in (one, other)]
    along = unit(normal[0] + np.sign(np.einsum("ij,ij->i", *normal))[:, None] * normal[1])
    # only what the two do not share can part
    free = [~(t[:, :, None] == o[:, None, :]).any(axis=2) for t, o in ((one, other), (other, one))]
    weights = [f / np.maximum(f.sum(axis=1, keepdims=True), 1) for f in free]
    middle = [np.einsum("ij,ijk->ik", w, x[t]) for w, t in zip(weights, (one, other), strict=True)]
    height = np.einsum("ij,ij->i", along, middle[0] - middle[1])
    half = (0.5 * gap * np.where(height < 0, -1.0, 1.0))[:, None] * along
    parts = [_shift_corners(t, w, shift) for t, w, shift in zip((one, other), weights, (half, -half), strict=True)]
    rows, signed, shifts = (np.concatenate([part[k] for part in parts]) for k in range(3))
    return rows, signed, shifts


def _body_targets(
    x: Floats, triangles: Ints, solid: Ints, pairs: Ints, gap: float, step: float, n_cloth: int
) -> list[Part]:
    """Ends of edges inside the body go out along the normals of its triangles; triangles go beyond its edges."""
    both = np.concatenate([triangles, solid])
    found = edge_triangle_intersections(x, both, pairs + np.array([0, len(triangles)]))
    of_cloth = found.edges[:, 0] < n_cloth
    inner = np.where(of_cloth, np.where(found.depths[:, 0] < found.depths[:, 1], 0, 1), -1)
    at_vertices = vertex_area_vectors(x, solid)
    rows = np.flatnonzero(~of_cloth)
    out = unit(at_vertices[found.edges[rows]].sum(axis=1))
    pierced = triangles[found.faces[rows]]
    point = np.einsum("ij,ijk->ik", found.barycentric[rows], x[pierced])
    highest = np.einsum("ijk,ik->ij", x[found.edges[rows]] - point[:, None], out).max(axis=1)
    touching = np.ones(len(pairs), bool)
    touching[found.of_pair[:, 1]] = False
    lifted = triangles[pairs[touching, 0]]
    return [
        _pull_through(both, found, inner, gap, step),
        _shift_corners(pierced, found.barycentric[rows], np.clip(highest + gap, 0.0, step)[:, None] * out),
        _shift_corners(lifted, np.full(lifted.shape, 1 / 3), gap * unit(area_vectors(x[solid[pairs[touching, 1]]]))),
    ]


def _shift_corners(corners: Ints, weights: Floats, shifts: Floats) -> Part:
    """Displacements (k, 3) of points of triangles, in rows of five as `_pull_through` has them."""
    none = np.zeros((len(corners), 2))
    return np.column_stack([corners, corners[:, :2]]), np.column_stack([weights, none]), shifts
