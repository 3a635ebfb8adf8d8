"""Deformation gradients of triangles in space as a linear operator (Sumner & Popovic 2004, section 3).

A triangle gets a fourth vertex v4 = v1 + (e1 x e2) / sqrt|e1 x e2|, so that its frame V = [e1 e2 v4-v1] can be
inverted, and T = V~ V^-1 maps its rest frame to its deformed one. T is linear in the deformed vertices and fourth
vertices, and x, y, z decouple: one scalar matrix serves all three.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.linalg import splu

from transfer.errors import TransferError
from transfer.triangle_surface import Floats, Ints

FLATTEST = 1e-8
"""A triangle has no area where its height is below this fraction of its longest edge."""


def cross(u: Floats, v: Floats) -> Floats:
    """Cross products of rows (m, 3); takes a third of the time of np.cross."""
    u0, u1, u2, v0, v1, v2 = *u.T, *v.T
    return np.stack([u1 * v2 - u2 * v1, u2 * v0 - u0 * v2, u0 * v1 - u1 * v0], axis=1)


def edge_vectors(positions: Floats, triangles: Ints) -> tuple[Floats, Floats]:
    """Edge vectors e1 = v2 - v1 and e2 = v3 - v1, (m, 3)."""
    a, b, c = (positions.take(triangles[:, k], axis=0) for k in range(3))
    return b - a, c - a


def doubled_areas(positions: Floats, triangles: Ints) -> Floats:
    """Cross products e1 x e2 (m, 3): twice the area times the normal."""
    return cross(*edge_vectors(positions, triangles))


def centroids(positions: Floats, triangles: Ints) -> Floats:
    """Centroids of the triangles, (m, 3)."""
    a, b, c = (positions.take(triangles[:, k], axis=0) for k in range(3))
    return (a + b + c) / 3.0


def mean_edge(positions: Floats, triangles: Ints) -> float:
    """Mean edge length of the triangles [the unit of `positions`]."""
    edges = positions[triangles] - positions[np.roll(triangles, 1, axis=1)]
    return float(np.linalg.norm(edges, axis=2).mean())


def without_area(positions: Floats, triangles: Ints) -> NDArray[np.bool_]:
    """True for triangles without area, which have no invertible frame, (m,)."""
    e1, e2 = edge_vectors(positions, triangles)
    return flat(e1, e2, cross(e1, e2))


def flat(e1: Floats, e2: Floats, e1_x_e2: Floats) -> NDArray[np.bool_]:
    """True for triangles with |e1 x e2| <= FLATTEST times their longest edge squared, (m,)."""
    squared = [np.einsum("ta,ta->t", v, v) for v in (e1, e2, e2 - e1, e1_x_e2)]
    return squared[3] <= (FLATTEST * np.maximum.reduce(squared[:3])) ** 2


def inverse_frames(positions: Floats, triangles: Ints, name: str, numbers: Ints | None = None) -> Floats:
    """Inverse frames V^-1 (m, 3, 3).

    Rows are the dual vectors e2 x c / |c|^2, c x e1 / |c|^2, c / |c|^(3/2), c = e1 x e2. TransferError where a
    triangle has no area; it is called by the mesh's `name` and its own row, or its row's entry of `numbers`.
    """
    e1, e2 = edge_vectors(positions, triangles)
    c = cross(e1, e2)
    bad = np.flatnonzero(flat(e1, e2, c))
    if len(bad):
        number = bad[0] if numbers is None else numbers[bad[0]]
        raise TransferError(
            f"triangle {number} of {name} has no area (vertices {triangles[bad[0]].tolist()}; {len(bad)} such in all).",
            "Remove or repair such triangles: they have no frame that a deformation could be read from.",
        )
    length = np.linalg.norm(c, axis=1, keepdims=True)
    return np.stack([cross(e2, c) / length**2, cross(c, e1) / length**2, c / length**1.5], axis=1)


def deformation_gradients(inverses: Floats, deformed: Floats, triangles: Ints) -> Floats:
    """Deformation gradients T = V~ V^-1 (m, 3, 3), from the `inverses` of its rest frames."""
    corners = deformed.T[:, triangles]  # one array for each coordinate: what follows runs along the triangles
    e, f = corners[:, :, 1] - corners[:, :, 0], corners[:, :, 2] - corners[:, :, 0]
    normal = e[[1, 2, 0]] * f[[2, 0, 1]] - e[[2, 0, 1]] * f[[1, 2, 0]]
    root = (normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2) ** 0.25
    n = np.divide(normal, root, out=np.zeros_like(normal), where=root > 0.0)
    rows = np.ascontiguousarray(inverses.transpose(1, 2, 0))
    out = np.empty((3, 3, len(triangles)))
    for a in range(3):
        out[a] = e[a] * rows[0] + f[a] * rows[1] + n[a] * rows[2]
    return np.ascontiguousarray(out.transpose(2, 0, 1))


def gradient_operator(inverses: Floats, triangles: Ints, vertices: int) -> csr_array:
    """Operator G (3m, n + m) with G [x; v4] = the transposed T of all triangles, stacked.

    `vertices` is n. Row 3t + b and coordinate a of the product are T_t[a, b]. Without its last m columns it gives T P,
    P the projector onto the rest triangle's plane (see `plane_operator`).
    """
    m = len(triangles)
    columns = np.column_stack([triangles, vertices + np.arange(m)])
    values = np.concatenate([-inverses.sum(axis=1, keepdims=True), inverses], axis=1)
    return assemble(columns, values, vertices + m)


def plane_operator(inverses: Floats, triangles: Ints, vertices: int) -> csr_array:
    """Operator G_P (3m, n) with G_P x = the transposed T P of all triangles, P the projector onto the rest plane.

    The first two rows of V^-1 are the dual vectors of e1 and e2 in the plane. Where every v4 is free, as in the
    transfer of a pose, T = S along the normal costs nothing: min |S - T|^2 over v4 is |(S - T) P|^2, and the
    unknowns n + m shrink to n. It is the exact Schur complement of the full system.
    """
    plane = inverses[:, :2]
    values = np.concatenate([-plane.sum(axis=1, keepdims=True), plane], axis=1)
    return assemble(triangles, values, vertices)


def assemble(columns: Ints, values: Floats, width: int) -> csr_array:
    """Sparse matrix (3m, width) with values[t, j, b] in row 3t + b and column columns[t, j]."""
    m, corners = columns.shape
    rows = np.broadcast_to(3 * np.arange(m)[:, None, None] + np.arange(3), (m, corners, 3))
    where = np.broadcast_to(columns[:, :, None], (m, corners, 3))
    return csr_array((values.ravel(), (rows.ravel(), where.ravel())), shape=(3 * m, width))


def factorise(matrix: csr_array) -> Any:
    """SuperLU factorization of a symmetric positive definite matrix: `.solve(b)` with b (n,) or (n, k)."""
    return splu(matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
