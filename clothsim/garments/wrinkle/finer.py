"""Subdivision of a triangle mesh: each edge in n parts, new positions linear or curved (Phong tessellation)."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from clothsim.base.arrays import Floats, Ints
from clothsim.base.linalg import unit
from clothsim.base.triangles import vertex_area_vectors

ROUNDNESS = 0.5
"""Weight of the projections on the tangent planes of the corners (Boubekeur and Alexa 2008, "Phong Tessellation").

A half is exact on arcs and paraboloids; three quarters, which the paper takes for looks, are too round.
"""


@dataclass(frozen=True)
class Subdivision:
    """A mesh whose edges are divided in `parts`.

    Attributes
    ----------
    parts : int
    coarse : (m, 3) int array
        Triangles of the mesh.
    weights : (k, n) sparse array
        Barycentric coordinates of each vertex of the finer mesh; the first n vertices are those of the mesh.
    triangles : (m parts^2, 3) int array
        Those of the finer mesh, `parts`^2 for each triangle, in its order.
    corners : (m parts^2, 3, 3) array
        Barycentric coordinates of the corners of each in the triangle that it is a part of.
    """

    parts: int
    coarse: Ints
    weights: csr_array
    triangles: Ints
    corners: Floats

    def linear(self, values: Floats) -> Floats:
        """Values (n, ...) of the vertices of the mesh at those of the finer one, on its flat triangles."""
        flat = np.asarray(values, np.float64).reshape(len(values), -1)
        return (self.weights @ flat).reshape(-1, *values.shape[1:])

    def curved(self, positions: Floats) -> Floats:
        """Positions (k, 3) [m] on a surface that is curved as the vertex normals of (n, 3) say, through all vertices.

        A point p on a flat triangle becomes p - a sum w (n'(p - x)) n over its corners x with normals n.
        """
        normals, flat = normals_or_zero(positions, self.coarse), self.linear(positions)
        pairs = self.weights.tocoo()
        n = normals[pairs.col]
        heights = pairs.data * ((flat[pairs.row] - positions[pairs.col]) * n).sum(axis=1)
        moved = flat.copy()
        np.subtract.at(moved, pairs.row, ROUNDNESS * heights[:, None] * n)
        return moved

    def of_triangles(self, values: Floats) -> Floats:
        """Values (m, 3, ...) of the corners of the triangles at those of the finer ones, (m parts^2, 3, ...)."""
        parents = np.repeat(np.asarray(values, np.float64), self.parts**2, axis=0)
        return np.einsum("tck,tk...->tc...", self.corners, parents)


def subdivision(triangles: Ints, n: int, parts: int) -> Subdivision:
    """Divide each edge of a mesh of `n` vertices in `parts`.

    Examples
    --------
    >>> import numpy as np
    >>> halves = subdivision(np.array([[0, 1, 2]]), 3, 2)
    >>> halves.linear(np.array([[0.0, 0, 0], [2, 0, 0], [0, 2, 0]]))[3:].tolist()
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]]
    >>> halves.triangles.shape
    (4, 3)
    """
    lattice = np.array([(parts - j - k, j, k) for k in range(parts + 1) for j in range(parts + 1 - k)])
    at = {(int(j), int(k)): row for row, (_, j, k) in enumerate(lattice)}
    upward = [(at[j, k], at[j + 1, k], at[j, k + 1]) for k in range(parts) for j in range(parts - k)]
    downward = [(at[j + 1, k], at[j + 1, k + 1], at[j, k + 1]) for k in range(parts - 1) for j in range(parts - 1 - k)]
    pieces = np.array(upward + downward)
    # A point is known by its corners and their weights, whichever triangle it is seen from.
    keys = np.empty((len(triangles), len(lattice), 3), np.int64)
    order = np.argsort(triangles, axis=1)
    keys[:] = 0
    ascending = np.take_along_axis(triangles, order, axis=1)
    counts = np.take_along_axis(np.broadcast_to(lattice, (len(triangles), *lattice.shape)), order[:, None, :], axis=2)
    keys = np.where(counts > 0, (ascending[:, None, :] + 1) * (parts + 1) + counts, 0)
    keys = np.sort(keys.reshape(-1, 3), axis=1)
    rank = (keys > 0).sum(axis=1)  # corners first: they have one weight
    sortable = np.column_stack([rank, np.where(rank[:, None] == 1, keys[:, ::-1], keys)])
    points, number = np.unique(sortable, axis=0, return_inverse=True)
    number = number.reshape(len(triangles), len(lattice))
    columns, shares = points[:, 1:] // (parts + 1) - 1, points[:, 1:] % (parts + 1)
    used = shares > 0
    rows = np.repeat(np.arange(len(points)), 3).reshape(-1, 3)
    missing = np.setdiff1d(np.arange(n), columns[used])  # a vertex of no triangle keeps its number
    if len(missing):
        raise ValueError(f"vertex {missing[0]} is in no triangle")
    weights = csr_array((shares[used] / parts, (rows[used], columns[used])), shape=(len(points), n))
    corners = np.broadcast_to(lattice[pieces] / parts, (len(triangles), *pieces.shape, 3)).reshape(-1, 3, 3)
    return Subdivision(parts, triangles, weights, number[:, pieces].reshape(-1, 3), corners)


def normals_or_zero(positions: Floats, triangles: Ints) -> Floats:
    """Unit normals of the vertices, the means of their triangles by area, (n, 3); 0 where there is none."""
    return unit(vertex_area_vectors(positions, triangles))
