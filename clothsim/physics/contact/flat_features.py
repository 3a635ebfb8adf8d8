"""Flat features of a body: points and edges inside a flat face, which no contact needs.

A cloth that touches a flat face touches it with its own vertices, or at the border of the face. An edge between two
coplanar triangles, and a vertex all of whose edges are such, are features of the triangulation alone: contact with them
would push a sheet along the face, from where such features are under it to where none are.
"""

from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.mesh.topology import interior_edges, unique_edges

FLAT = 1e-5
"""Angle between two faces up to which they count as one [rad]: the round-off of files. The edge between faces of a
metre then lies at most 2.5 um from their common plane."""


@dataclass(frozen=True)
class FlatFeatures:
    """Rows of the points (p,) and of the edges (e, 2), sorted, inside flat faces."""

    points: Ints
    edges: Ints

    def shifted(self, first: int) -> "FlatFeatures":
        """The same features of a body that begins at row `first`."""
        return FlatFeatures(self.points + first, self.edges + first)


NO_FLAT_FEATURES = FlatFeatures(np.zeros(0, np.int64), np.zeros((0, 2), np.int64))


def flat_features(positions: Floats, triangles: Ints) -> FlatFeatures:
    """Points and edges of a surface, positions (n, 3) [m] and triangles (m, 3), inside its flat faces.

    Examples
    --------
    The diagonals of a box are flat, its corners and ridges are not:

    >>> from clothsim.mesh.generators.table import GENERATORS
    >>> found = flat_features(*GENERATORS["slab"](size=(1.0, 1.0, 0.1)))
    >>> len(found.edges), len(found.points)
    (6, 0)
    """
    hinges, _ = interior_edges(triangles)
    start, end, opposite, other = (positions[column] for column in hinges.T)
    along = _unit(end - start)
    inward, other_inward = (_unit(_across(corner - start, along)) for corner in (opposite, other))
    flat = np.linalg.norm(inward + other_inward, axis=1) <= FLAT
    flat &= (inward != 0.0).any(axis=1)  # a face without area has no direction
    edges = np.sort(hinges[flat, :2], axis=1)
    n_edges, n_flat = (np.bincount(rows.ravel(), minlength=len(positions)) for rows in (unique_edges(triangles), edges))
    points = np.flatnonzero((n_edges > 0) & (n_edges == n_flat))
    return FlatFeatures(points, edges)


def _unit(vectors: Floats) -> Floats:
    """Vectors (n, 3) of length 1; 0 stays 0."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0.0)


def _across(vectors: Floats, along: Floats) -> Floats:
    """Components of vectors (n, 3) perpendicular to the unit vectors `along` (n, 3)."""
    return np.asarray(vectors - (vectors * along).sum(axis=1, keepdims=True) * along, np.float64)
