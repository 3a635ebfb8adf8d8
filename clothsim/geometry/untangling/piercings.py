"""Edge-triangle intersections of a list of intersecting triangle pairs, in doubles.

Which pairs intersect is decided by the exact check; where they do is needed to a few digits only.
"""

from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats, Ints

SLACK = 1e-9
"""Barycentric coordinates above minus this are inside a triangle."""


@dataclass(frozen=True)
class Piercings:
    """Points where edges pierce triangles, each once, however many pairs it belongs to.

    Parameters
    ----------
    edges : (k, 2) int64
        Vertices of each edge, the lower first.
    faces : (k,) int64
        Triangle that it pierces.
    along : (k,) float64
        Position on the edge: 0 at its first vertex, 1 at its second.
    barycentric : (k, 3) float64
        Position in the triangle.
    normals : (k, 3) float64
        Unit normal of the triangle.
    depths : (k, 2) float64
        Signed distances of the ends of the edge from the plane of the triangle [m]: of opposite signs.
    of_pair : (q, 3) int64
        Incidences: piercing, pair, and which triangle of the pair the edge is of (0 or 1).
    """

    edges: Ints
    faces: Ints
    along: Floats
    barycentric: Floats
    normals: Floats
    depths: Floats
    of_pair: Ints


def piercings(x: Floats, triangles: Ints, pairs: Ints) -> Piercings:
    """Return the piercings of intersecting `pairs (p, 2)` of `triangles (m, 3)`.

    Parameters
    ----------
    x : (n, 3) array
        Positions [m].
    triangles : (m, 3) int array
        Vertex indices.
    pairs : (p, 2) int array
        Triangles that intersect.

    Examples
    --------
    >>> x = np.array([[0.0, 0, 0], [4, 0, 0], [0, 4, 0], [1, 1, -1], [1, 1, 1], [9, 9, 0]])
    >>> found = piercings(x, np.array([[0, 1, 2], [3, 4, 5]]), np.array([[0, 1]]))
    >>> found.edges.tolist(), found.along.tolist()
    ([[1, 2], [3, 4]], [0.5, 0.5])
    """
    edges, faces, origin = _candidates(triangles, pairs)
    p, q = x[edges[:, 0]], x[edges[:, 1]]
    a, b, c = (x[triangles[faces, corner]] for corner in range(3))
    normals = np.cross(b - a, c - a)
    size = np.linalg.norm(normals, axis=1)
    normals /= np.where(size > 0, size, 1.0)[:, None]
    depths = np.column_stack([np.einsum("ij,ij->i", normals, end - a) for end in (p, q)])
    apart = depths[:, 0] - depths[:, 1]
    along = depths[:, 0] / np.where(apart != 0, apart, 1.0)
    point = p + along[:, None] * (q - p)
    barycentric = _barycentric(point, a, b, c, normals, size)
    there = (apart != 0) & (size > 0) & (along >= 0) & (along <= 1) & (barycentric >= -SLACK).all(axis=1)
    key = np.column_stack([edges, faces])[there]
    _, first, number = np.unique(key, axis=0, return_index=True, return_inverse=True)
    rows = np.flatnonzero(there)[first]
    incidences = np.column_stack([number.ravel(), origin[there]])
    return Piercings(edges[rows], faces[rows], along[rows], barycentric[rows], normals[rows], depths[rows], incidences)


def _candidates(triangles: Ints, pairs: Ints) -> tuple[Ints, Ints, Ints]:
    """Edges of one triangle of each pair that have no vertex of the other, those others, and (pair, role) of each."""
    edges, faces, origin = [], [], []
    for role in (0, 1):
        own, other = triangles[pairs[:, role]], pairs[:, 1 - role]
        for k in range(3):
            edge = np.sort(own[:, [k, (k + 1) % 3]], axis=1)
            free = ~(edge[:, :, None] == triangles[other][:, None, :]).any(axis=(1, 2))
            rows = np.flatnonzero(free)
            edges.append(edge[rows])
            faces.append(other[rows])
            origin.append(np.column_stack([rows, np.full(len(rows), role)]))
    return np.concatenate(edges), np.concatenate(faces), np.concatenate(origin)


def _barycentric(point: Floats, a: Floats, b: Floats, c: Floats, normals: Floats, size: Floats) -> Floats:
    """Barycentric coordinates (k, 3) of points in the planes of triangles of doubled area `size`."""
    doubled = np.where(size > 0, size, 1.0)
    at_b = np.einsum("ij,ij->i", np.cross(point - a, c - a), normals) / doubled
    at_c = np.einsum("ij,ij->i", np.cross(b - a, point - a), normals) / doubled
    return np.column_stack([1 - at_b - at_c, at_b, at_c])
