"""Penetration removal by least squares (Guan et al. 2012, DRAPE, section 4.3; sign and schedule corrected).

Each pass minimises over the new positions y, y~ being those before it and d = y - y~,

    sum_(rows r) (n_r . ((B y)_r - b_r) - eps_r)^2 + lam_s sum_i |d_i - mean of d over the neighbours of i|^2
    + lam_d sum_i |d_i|^2,

b_r the closest point of the body and n_r its OUTWARD normal, both recomputed in each pass. A row is a vertex, and
beyond the paper the middle of an edge or of a triangle (B has weights 1, 1/2 or 1/3), as a triangle may cut the body
though its corners are outside; and a row is active as soon as it is nearer than eps, or the next pass undoes the last.

There is no guarantee: check the result by exact triangle intersection, never by vertices alone.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array, diags_array, eye_array, hstack, kron, vstack
from scipy.sparse.linalg import cg

from transfer.errors import TransferError
from transfer.signed_distance import BodySurface, body_surface
from transfer.triangle_surface import (
    Floats,
    Ints,
    Sparse,
    adjacency,
    as_surface,
    convex_curvature,
    edges_of,
    longest_edges,
    unit,
    vertex_normals,
)

SMOOTHNESS, DAMPING = (4.0, 2.0, 1.0), (0.8, 0.6, 0.4)
"""lam_s and lam_d of the first three passes; later ones keep the last."""
PASSES = 12
"""Most passes. Measured: three leave 30 mm of penetration, and more than twelve gain nothing."""
FLOOR, CEILING = 0.1, 0.15
"""Fractions of the garment's median edge (least eps) and of the local edge (most for curvature, as bodies
have creases). Measured on real suits: a floor of .05 leaves 2 intersecting pairs; a ceiling of .5 stretches by 1.52."""
RESIDUAL, ITERATIONS = 1e-10, 1000


@dataclass(frozen=True)
class Refined:
    """Result of `refine`.

    Attributes
    ----------
    positions : ndarray (n, 3)
        Refined garment [m].
    inside : tuple of int
        Number of vertices inside the body before each pass and at the end.
    depth : tuple of float
        Depth of the deepest row (vertex, middle of an edge or of a triangle) at the same times [m].
    eps : ndarray (n,)
        Target distance of each vertex in the last pass [m]; zeros without a pass.
    """

    positions: Floats
    inside: tuple[int, ...]
    depth: tuple[float, ...]
    eps: Floats

    @property
    def passes(self) -> int:
        """Number of passes made."""
        return len(self.inside) - 1


@dataclass(frozen=True)
class ActiveRows:
    """Active rows of one pass: indices (k,), outward normals (k, 3), and distances to their target (k,) [m]."""

    rows: Ints
    normals: Floats
    gaps: Floats


def refine(
    garment_positions: ArrayLike,
    garment_triangles: ArrayLike,
    body_positions: ArrayLike,
    body_triangles: ArrayLike,
    *,
    eps: float | None = None,
    passes: int = PASSES,
    samples: bool = True,
    along_normals: bool = False,
) -> Refined:
    """Move a garment out of a body; one without a penetrating vertex or sample is returned unchanged.

    Parameters
    ----------
    garment_positions : array_like (n, 3)
        Garment vertices [m].
    garment_triangles : array_like (m, 3)
    body_positions : array_like (k, 3)
        Body vertices [m].
    body_triangles : array_like (l, 3)
    eps : float, optional
        Target distance from the body [m], > 0. None: from edge lengths and curvature (`clearances`).
    passes : int
        Most passes, >= 1.
    samples : bool
        Treat the middles of edges and triangles as well as the vertices.
    along_normals : bool
        Where garment and closest point have opposite normals, use the exit point along the garment's normal: right for
        limbs whose far side is nearer, wrong in folds; a second attempt.

    Raises
    ------
    TransferError
        Invalid arrays, eps or passes, or a body without a volume.

    Examples
    --------
    A triangle 1 mm below the top of a box:

    >>> import numpy as np
    >>> from transfer.refine import refine
    >>> box = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    >>> faces = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
    ...                   [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]])
    >>> cloth = np.array([[0.4, 0.4, 0.999], [0.6, 0.4, 0.999], [0.5, 0.6, 0.999]])
    >>> done = refine(cloth, [[0, 1, 2]], box, faces, eps=0.002)
    >>> done.inside[0], done.inside[-1], bool((done.positions[:, 2] > 1).all())
    (3, 0, True)
    """
    return refined_on(
        body_surface(body_positions, body_triangles),
        garment_positions,
        garment_triangles,
        eps=eps,
        passes=passes,
        samples=samples,
        along_normals=along_normals,
    )


def refined_on(
    body: BodySurface,
    garment_positions: ArrayLike,
    garment_triangles: ArrayLike,
    *,
    eps: float | None = None,
    passes: int = PASSES,
    samples: bool = True,
    along_normals: bool = False,
) -> Refined:
    """`refine` on a body that is prepared already."""
    x, triangles = as_surface("garment", garment_positions, garment_triangles)
    if eps is not None and not 0 < eps < np.inf:
        raise TransferError(f"eps is {eps!r}.", "Give a positive distance in metres.")
    if passes < 1:
        raise TransferError(f"passes is {passes!r}.", "Give at least 1.")
    edges = edges_of(triangles)
    weights = sample_weights(triangles, edges, len(x)) if samples else _identity(len(x))
    aims = clearances(x, edges, body) if eps is None else None
    smoothing = _deviation(edges, len(x))
    inside, depth, used = [], [], np.zeros(len(x))
    for k in range(passes + 1):
        closest = body.closest(weights @ x)
        inside.append(int(closest.inside[: len(x)].sum()))
        depth.append(max(0.0, -float(closest.signed_distance.min())))
        if k == passes or not closest.inside.any():
            break
        wanted = np.full(len(closest.points), eps) if aims is None else aims.of(weights, closest.triangles)
        distance, normals = closest.signed_distance, closest.normals
        if along_normals:
            distance, normals = _seen_along_normals(body, x, triangles, weights, distance, normals)
        rows = np.flatnonzero(distance < wanted)
        targets = ActiveRows(rows, normals[rows], wanted[rows] - distance[rows])
        x, used = x + displacement(weights, targets, smoothing, k), wanted[: len(x)]
    return Refined(x, tuple(inside), tuple(depth), used)


@dataclass(frozen=True)
class Clearance:
    """Terms of eps.

    edges (n,) [m], the longest edge at each garment vertex; curvature (m,) [1/m] of body triangles; floor [m], the
    least eps.
    """

    edges: Floats
    curvature: Floats
    floor: float

    def of(self, weights: Sparse, triangles: Ints) -> Floats:
        """Target distance eps of each row, (k,) [m], given its closest body triangle, `triangles` (k,)."""
        edges = weights @ self.edges
        sagitta = edges**2 * self.curvature[triangles] / 6
        return np.asarray(self.floor + np.minimum(sagitta, CEILING * edges))


def clearances(garment_positions: Floats, edges: Ints, body: BodySurface) -> Clearance:
    """Target distance eps = edge^2 curvature / 6 + floor.

    A chord of length h between points on a sphere of curvature c is h^2 c / 8 below it, the middle of an equilateral
    triangle of edge h h^2 c / 6.
    """
    longest = longest_edges(garment_positions, edges)
    at_vertices = convex_curvature(body.positions, body.triangles)
    return Clearance(longest, at_vertices[body.triangles].max(axis=1), FLOOR * float(np.median(longest[longest > 0])))


def displacement(weights: Sparse, targets: ActiveRows, smoothing: Sparse, k: int) -> Floats:
    """Displacement d of pass k, (n, 3) [m]: the solution of its normal equations."""
    matrix, right = normal_equations(weights, targets, smoothing, k)
    # The eigenvalues lie between lam_d and 4 lam_s + lam_d + the rows at a vertex: a factorization does not pay.
    solution, failed = cg(matrix, right, rtol=RESIDUAL, maxiter=ITERATIONS, M=diags_array(1 / matrix.diagonal()))
    if failed:
        raise TransferError(f"The equations of refinement pass {k} were not solved in {ITERATIONS} iterations.")
    return np.ascontiguousarray(solution.reshape(3, -1).T)


def normal_equations(weights: Sparse, targets: ActiveRows, smoothing: Sparse, k: int) -> tuple[Sparse, Floats]:
    """Symmetric positive definite matrix (3n, 3n) and right-hand side (3n,) of pass k: all x, then y, then z."""
    lam_s, lam_d = (schedule[min(k, len(schedule) - 1)] for schedule in (SMOOTHNESS, DAMPING))
    chosen = weights[targets.rows]
    along = hstack([diags_array(targets.normals[:, axis]) @ chosen for axis in range(3)]).tocsr()
    still = lam_s * (smoothing.T @ smoothing) + lam_d * eye_array(weights.shape[1])
    return (kron(eye_array(3), still) + along.T @ along).tocsr(), along.T @ targets.gaps


def sample_weights(triangles: Ints, edges: Ints, n_vertices: int) -> Sparse:
    """Sample operator B (n + e + m, n): vertices, then middles of edges, then of triangles."""

    def means(corners: Ints) -> Sparse:
        count, size = corners.shape
        indices = (np.repeat(np.arange(count), size), corners.ravel())
        return csr_array((np.full(count * size, 1 / size), indices), shape=(count, n_vertices))

    return vstack([_identity(n_vertices), means(edges), means(triangles)]).tocsr()


def _deviation(edges: Ints, n_vertices: int) -> Sparse:
    """Operator L (n, n): value of a vertex minus the mean of its neighbours; zero for a vertex without any."""
    ring = adjacency(edges, n_vertices)
    degree = ring.sum(axis=1)
    joined = degree > 0
    return diags_array(joined.astype(float)) - diags_array(1 / np.where(joined, degree, 1)) @ ring


def _identity(n: int) -> Sparse:
    return eye_array(n).tocsr()


def _seen_along_normals(
    body: BodySurface, x: Floats, triangles: Ints, weights: Sparse, distance: Floats, normals: Floats
) -> tuple[Floats, Floats]:
    """Distances and normals of the rows, along the garment's normal for those inside with an opposite normal.

    The outer side of the garment is the one that agrees with the body over most of its vertices near it. A row whose
    normal does not leave the body, or at a grazing angle only, gets an infinite distance and follows its neighbours.
    """
    own = vertex_normals(x, triangles)
    near = np.abs(distance[: len(x)]) <= np.median(np.abs(distance[: len(x)]))
    side = 1.0 if (own * normals[: len(x)]).sum(axis=1)[near].sum() >= 0 else -1.0
    facing = unit(side * (weights @ own))
    turned = np.flatnonzero((distance < 0) & ((facing * normals).sum(axis=1) < 0))
    distance, normals = distance.copy(), normals.copy()
    lengths, met = body.exits(weights[turned] @ x, facing[turned])
    there = body.triangle_normals[met]
    slope = (there * facing[turned]).sum(axis=1)
    hits = np.logical_and(np.isfinite(lengths), slope > 0.2)
    distance[turned] = np.where(hits, -np.where(hits, lengths, 0) * slope, np.inf)
    normals[turned] = there
    return distance, normals
