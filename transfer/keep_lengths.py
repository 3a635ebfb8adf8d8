"""As-rigid-as-possible garment with prescribed lengths near a given shape (Sorkine and Alexa 2007, Liu et al. 2008).

min over x of sum over triangles A |F - R|^2 + sum over vertices A / L^2 |x - a|^2 + W A |(x - p)|^2, F the deformation
gradient from the triangle's prescribed shape, R the nearest rotation, a the given shape and p a point outside the body
for vertices in it. Local steps find R, global ones x.
"""

import numpy as np
from scipy.sparse import csr_array, diags_array

from transfer.gradients import factorise
from transfer.signed_distance import BodySurface
from transfer.triangle_surface import Floats, Ints

ROUNDS, STEPS = 8, 12
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
        for _ in range(STEPS):
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
