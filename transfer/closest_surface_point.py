"""Closest surface points with compatible normals (Sumner & Popovic 2004, section 3.1)."""

from dataclasses import dataclass
from typing import Any

import igl
import numpy as np
from scipy.spatial import cKDTree

from transfer.gradients import centroids
from transfer.triangle_surface import Floats, Ints, triangle_normals

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
