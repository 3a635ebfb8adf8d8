"""Garment of one body on another: deformation transfer, and a shape near it with prescribed lengths.

Each garment triangle takes the mean S of the body triangles that it lies over, weighted by distance so that neighbours
do not jump; and each vertex is anchored weakly at the mean position to which these map it, so that integrating S does
not drift away from the body. Penetration of the body is not prevented: `refine` has to follow.

Prescribed lengths make it an as-rigid-as-possible shape (Sorkine and Alexa 2007, Liu et al. 2008): min over x of sum
over triangles A |F - R|^2 + sum over vertices A / L^2 |x - a|^2 + W A |(x - p)|^2, F the deformation gradient from the
triangle's prescribed shape, R the nearest rotation, a the given shape and p a point outside the body for vertices in
it. Local steps find R, global ones x.
"""

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array, diags_array
from scipy.spatial import cKDTree

from transfer.deform import DeformationTransfer, deformation_transfer
from transfer.errors import TransferError
from transfer.gradients import centroids, factorise, mean_edge, without_area
from transfer.signed_distance import BodySurface
from transfer.triangle_surface import Floats, Ints, as_surface, triangle_normals, vertex_components

FOLLOWED, CANDIDATES = 16, 64
"""Most body triangles that a garment triangle follows, and nearest ones that are searched."""
FAINTEST = 1e-6
"""A body triangle with a weight below this is left out."""
BLEND_LENGTH = 0.05
"""Length, as a fraction of the body's longest side, below which gradients and above which anchors dominate. A tenth
of a metre on a person; of .02 to .3 m, longer ones drift and shorter ones imprint the body on the cloth."""


def transfer_garment(
    garment_positions: ArrayLike,
    garment_triangles: ArrayLike,
    source_body: ArrayLike,
    target_body: ArrayLike,
    body_triangles: ArrayLike,
) -> Floats:
    """Transfer a garment from one body to another of the same mesh.

    For bodies of different topology call `correspond` first: its `positions` are the source body in the shape of the
    target. Vertices may end up inside the body; `refine` moves them out.

    Parameters
    ----------
    garment_positions : array_like (n, 3)
        Garment on the source body [m].
    garment_triangles : array_like (m, 3)
    source_body, target_body : array_like (k, 3)
        Vertices of both bodies [m].
    body_triangles : array_like (l, 3)
        Mesh of both bodies.

    Returns
    -------
    ndarray (n, 3)
        Garment on the target body [m].

    Raises
    ------
    TransferError
        Invalid arrays, or garment triangles without area.

    Examples
    --------
    A square above a tetrahedron that becomes twice as large:

    >>> import numpy as np
    >>> from transfer.garment import transfer_garment
    >>> body = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    >>> faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    >>> cloth = np.array([[0, 0, 2], [1, 0, 2], [1, 1, 2], [0, 1, 2.0]])
    >>> fitted = transfer_garment(cloth, [[0, 1, 2], [0, 2, 3]], body, 2 * body, faces)
    >>> bool(np.allclose(fitted, 2 * cloth))
    True
    """
    follower = garment_transfer(garment_positions, garment_triangles, source_body, body_triangles)
    return follower.pose(source_body, body_triangles, target_body)


def garment_transfer(
    garment_positions: ArrayLike, garment_triangles: ArrayLike, body_positions: ArrayLike, body_triangles: ArrayLike
) -> DeformationTransfer:
    """Factorize the transfer of a garment on its body: `.pose(body, body_triangles, other_body)` for each body."""
    garment = as_surface("garment", garment_positions, garment_triangles)
    body = as_surface("body", body_positions, body_triangles)
    pairs, weights = pairs_with_body(garment, body)
    length = BLEND_LENGTH * float(np.ptp(body[0][np.unique(body[1])], axis=0).max())
    return deformation_transfer(*garment, pairs, weights, anchor=2.0 / length**2)


def pairs_with_body(garment: tuple[Floats, Ints], body: tuple[Floats, Ints]) -> tuple[Ints, Floats]:
    """Pairs (p, 2): (body triangle, garment triangle), and weights (p,) of sum 1 for each garment triangle.

    Of the nearest body triangles those with a compatible normal are used (each component of the garment may be wound
    in either orientation), or all where none has; weights exp(-(d^2 - d_0^2) / h^2), d_0 the nearest distance and
    h = max(d_0, mean edge of the body): the farther the cloth, the broader the mean.
    """
    sound = np.flatnonzero(~without_area(*body))
    if len(sound) == 0:
        raise TransferError("the body has no triangle with an area.", "Give a triangulated surface.")
    over = body[0], body[1][sound]
    count = min(CANDIDATES, len(sound))
    distance, near = cKDTree(centroids(*over)).query(centroids(*garment), k=np.arange(1, count + 1))
    facing = np.einsum("ta,tka->tk", outward(garment, over, near[:, 0]), triangle_normals(*over)[near]) > 0
    facing[~facing.any(axis=1)] = True
    distance = np.where(facing, distance, np.inf)
    order = np.argsort(distance, axis=1, kind="stable")[:, :FOLLOWED]
    distance, near = np.take_along_axis(distance, order, axis=1), np.take_along_axis(near, order, axis=1)
    nearest = distance[:, :1]
    weights = np.exp((nearest**2 - distance**2) / np.maximum(nearest, mean_edge(*over)) ** 2)
    significant = weights > FAINTEST
    rows = np.broadcast_to(np.arange(len(near))[:, None], near.shape)[significant]
    sums = np.bincount(rows, weights[significant])
    return np.column_stack([sound[near[significant]], rows]), weights[significant] / sums[rows]


def outward(garment: tuple[Floats, Ints], body: tuple[Floats, Ints], nearest: Ints) -> Floats:
    """Garment normals (t, 3), each component oriented like most of the nearest body triangles."""
    normals = triangle_normals(*garment)
    piece = vertex_components(garment[1], len(garment[0]))[garment[1][:, 0]]
    agreement = np.bincount(piece, np.einsum("ta,ta->t", normals, triangle_normals(*body)[nearest]))
    return np.where(agreement[piece] < 0, -1.0, 1.0)[:, None] * normals


ROUNDS, LOCAL_GLOBAL_STEPS = 8, 12
"""Rounds, each with the body queried once, and local-global steps in each."""
ANCHOR = 0.4
"""L as a fraction of the height of the body: lengths win over the given shape below it."""
CLEARANCE, PUSH = 0.003, 4000.0
"""Distance from the body that a vertex shall have at least [m], and W [1/m^2]."""


def with_lengths(
    positions: Floats, triangles: Ints, given: Floats, metric: Floats, body: BodySurface, height: float
) -> Floats:
    """Shape near `positions` (n, 3) [m] with the lengths of `given` (n, 3) in the metric (m, 3, 3) of its triangles.

    Vertices in the body are drawn out of it, weakly: a refinement has to follow. height: of the body [m].
    """
    planes = prescribed_shapes(given, triangles, metric)
    areas = np.abs(np.linalg.det(planes)) / 2.0
    inverses = np.linalg.inv(planes)  # columns of `planes` are the edges in the plane
    n, m = len(positions), len(triangles)
    rows = np.repeat(np.arange(2 * m).reshape(m, 2, 1), 3, axis=2)
    values = np.concatenate([-inverses.sum(axis=1)[:, None], inverses], axis=1).transpose(0, 2, 1)
    columns = np.repeat(triangles[:, None, :], 2, axis=1)
    gradient = csr_array((values.ravel(), (rows.ravel(), columns.ravel())), shape=(2 * m, n))
    weighted = (gradient.T @ diags_array(np.repeat(areas, 2))).tocsr()
    mass = np.bincount(triangles.ravel(), np.repeat(areas, 3) / 3.0, minlength=n)
    mass = np.maximum(mass, 1e-12)
    anchor = mass / (ANCHOR * height) ** 2
    stiffness = weighted @ gradient
    x = positions.copy()
    for _ in range(ROUNDS):
        closest = body.closest(x)
        inside = closest.signed_distance < CLEARANCE
        push = np.where(inside, PUSH * mass, 0.0)
        out = x + (CLEARANCE - closest.signed_distance)[:, None] * closest.normals
        factor = factorise((stiffness + diags_array(anchor + push)).tocsr())
        fixed = anchor[:, None] * positions + push[:, None] * out
        for _ in range(LOCAL_GLOBAL_STEPS):
            F = (gradient @ x).reshape(m, 2, 3).transpose(0, 2, 1)
            R = nearest_orthonormal(F).transpose(0, 2, 1).reshape(2 * m, 3)
            x = factor.solve(weighted @ R + fixed)
    return np.asarray(x)


def prescribed_shapes(given: Floats, triangles: Ints, metric: Floats) -> Floats:
    """Edges (m, 2, 2) in the plane, as columns, of triangles with the lengths of `given` in their metric (m, 3, 3)."""
    corners = given[triangles]
    edges = corners[:, 1:] - corners[:, :1]
    gram = np.einsum("kia,kab,kjb->kij", edges, metric, edges)
    first = np.sqrt(gram[:, 0, 0])
    along = gram[:, 0, 1] / first
    across = np.sqrt(np.maximum(gram[:, 1, 1] - along**2, 1e-6 * gram[:, 1, 1]))
    zero = np.zeros_like(first)
    return np.stack([np.stack([first, along], axis=1), np.stack([zero, across], axis=1)], axis=1)


def nearest_orthonormal(F: Floats) -> Floats:
    """Nearest matrices with orthonormal columns to F (m, 3, 2): F (F^T F)^(-1/2), the root in closed form."""
    C = np.einsum("kai,kaj->kij", F, F)
    area = np.sqrt(np.maximum(C[:, 0, 0] * C[:, 1, 1] - C[:, 0, 1] ** 2, 1e-16))
    trace = np.sqrt(C[:, 0, 0] + C[:, 1, 1] + 2.0 * area)
    # U = sqrt(C) = (C + area I) / trace; U^-1 = (trace I - U) / area, as det U = area and tr U = trace
    inverse = (trace[:, None, None] * np.eye(2) - (C + area[:, None, None] * np.eye(2)) / trace[:, None, None]) / area[
        :, None, None
    ]
    return np.asarray(F @ inverse)
