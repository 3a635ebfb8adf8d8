"""Non-rigid registration of meshes of different topology (Sumner & Popovic 2004, section 4.1).

min over x, v4 of w_S sum over neighbours |T_i - T_j|^2 + w_I sum |T_i - I|^2 + w_C sum |x_i - c_i|^2, markers being
eliminated unknowns and c_i the closest point of the target with a compatible normal. w_C has the unit of 1 / length^2:
it is meant for a mean edge of 1.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import igl
import numpy as np
from scipy.sparse import csr_array, diags_array, eye_array, kron
from scipy.spatial import cKDTree

from transfer.errors import TransferError
from transfer.gradients import centroids, factorise, gradient_operator, inverse_frames
from transfer.triangle_surface import Floats, Ints, adjacent_triangles, triangle_normals, vertex_normals

CANDIDATES = 32
"""Nearest triangles searched where the closest point has an incompatible normal."""


@dataclass(frozen=True)
class FacingSurface:
    """Triangle mesh with search trees; made by `facing_surface`."""

    positions: Floats
    triangles: Ints
    normals: Floats
    middles: Floats
    boxes: Any
    tree: Any

    def closest_valid(self, points: Floats, normals: Floats) -> tuple[Ints, Floats]:
        """Closest valid triangles (k,), -1 for none, and positions (k, 3), of `points` (k, 3) with `normals` (k, 3).

        A point of the surface is valid where its triangle's normal makes less than 90 degrees with the given one.
        The closest point is taken where it is valid, else the nearest valid centroid of the CANDIDATES nearest
        triangles: on the far side of a fold the true point is within a triangle of it.
        """
        _, nearest, closest = self.boxes.squared_distance(self.positions, self.triangles, np.ascontiguousarray(points))
        triangles = np.asarray(nearest, dtype=np.int64).reshape(-1)
        positions = np.array(closest, dtype=np.float64).reshape(-1, 3)
        facing = np.einsum("ka,ka->k", self.normals[triangles], normals) > 0
        astray = np.flatnonzero(~facing)
        if len(astray):
            count = min(CANDIDATES, len(self.triangles))
            _, near = self.tree.query(points[astray], k=np.arange(1, count + 1))
            valid = np.einsum("kca,ka->kc", self.normals[near], normals[astray]) > 0
            first = near[np.arange(len(astray)), valid.argmax(axis=1)]
            triangles[astray] = np.where(valid.any(axis=1), first, -1)
            positions[astray] = self.middles[first]
        return triangles, positions


def facing_surface(positions: Floats, triangles: Ints) -> FacingSurface:
    """Build the search trees of a mesh, positions (n, 3) and triangles (m, 3)."""
    boxes = igl.AABB()
    positions, triangles = np.ascontiguousarray(positions), np.ascontiguousarray(triangles)
    boxes.init(positions, triangles)
    middles = centroids(positions, triangles)
    normals = triangle_normals(positions, triangles)
    return FacingSurface(positions, triangles, normals, middles, boxes, cKDTree(middles))


SMOOTHNESS, IDENTITY = 1.0, 1e-3
"""w_S and w_I."""
CLOSENESS = (1.0, 17.0, 292.0, 5000.0)
"""w_C of the four steps of phase 2: geometric from 1 to 5000."""
GENTLE = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1)
"""w_C of softer steps before them, for few or rough markers: w_S spreads an attraction over (w_S / w_C)^(1/4) edges,
so the first moves whole limbs, where 1 already moves single vertices."""
LET_GO = 1e-3
"""w_C from which rough markers are released: the limbs coincide by then, and a marker would only distort them."""


def lay_over(
    positions: Floats,
    triangles: Ints,
    target: FacingSurface,
    fixed: Ints,
    targets: Floats,
    rough: bool = False,
    progress: Callable[[str], None] | None = None,
    weights: tuple[float, ...] = (),
) -> Floats:
    """Register the mesh `positions` (n, 3), `triangles` (m, 3), mean edge length 1, to `target`; returns (n, 3).

    Vertices `fixed` (k,) go to `targets` (k, 3), at least one in each connected piece. `rough`: these are few and not
    exact; the GENTLE steps come first, and from LET_GO on they are free. Vertices of no triangle stay. weights: w_C of
    each step, in place of those.
    TransferError where no vertex has a compatible point of the target.
    """
    n = len(positions)
    operator = gradient_operator(inverse_frames(positions, triangles, "the source"), triangles, n)
    smooth = difference_operator(adjacent_triangles(triangles), len(triangles)) @ operator
    normal = SMOOTHNESS * (smooth.T @ smooth) + IDENTITY * (operator.T @ operator)
    right = IDENTITY * (operator.T @ np.tile(np.eye(3), (len(triangles), 1)))
    unknowns = np.concatenate([np.unique(triangles), n + np.arange(len(triangles))])
    laid = np.concatenate([positions, np.zeros((len(triangles), 3))])  # vertices, then fourth vertices
    weights = weights or (0.0, *(GENTLE if rough else ()), *CLOSENESS)
    laid[fixed] = targets
    for step, weight in enumerate(weights):
        held = fixed[:0] if rough and weight >= LET_GO else fixed
        moving = np.setdiff1d(unknowns, held)
        attraction_weights, closest = attraction(laid[:n], triangles, target, weight)
        system = normal[moving]
        matrix = system[:, moving] + diags_array(attraction_weights[moving])
        known = right[moving] + attraction_weights[moving, None] * closest[moving] - system[:, held] @ laid[held]
        laid[moving] = factorise(matrix).solve(known)
        if progress is not None:
            progress(f"registering the source to the target: {step + 1} of {len(weights)}")
    return laid[:n]


def attraction(laid: Floats, triangles: Ints, target: FacingSurface, weight: float) -> tuple[Floats, Floats]:
    """Weights (n + m,) and closest points (n + m, 3) of vertices and fourth vertices; weight 0 for none valid."""
    attraction_weights, closest = np.zeros(len(laid) + len(triangles)), np.zeros((len(laid) + len(triangles), 3))
    if weight:
        used = np.unique(triangles)
        nearest, closest[used] = target.closest_valid(laid[used], vertex_normals(laid, triangles)[used])
        attraction_weights[used] = weight * (nearest >= 0)
        if not attraction_weights.any():
            raise TransferError(
                "no point of the target has a normal compatible with the source.",
                "Reverse the orientation of one of them, or check the markers.",
            )
    return attraction_weights, closest


def difference_operator(pairs: Ints, count: int) -> csr_array:
    """Difference operator K (3p, 3m) of stacked 3x3 blocks over pairs; sqrt 2 as each pair counts in both orders."""
    rows = np.repeat(np.arange(len(pairs)), 2)
    values = np.sqrt(2.0) * np.tile([1.0, -1.0], len(pairs))
    return csr_array(kron(csr_array((values, (rows, pairs.ravel())), shape=(len(pairs), count)), eye_array(3)))
