"""Triangle surfaces as arrays: input checks, edges, adjacency, components, normals and curvature."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from transfer.errors import TransferError

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Sparse = Any
"""A scipy.sparse array: the library is imported only where it is used."""


def as_surface(name: str, positions: ArrayLike, triangles: ArrayLike) -> tuple[Floats, Ints]:
    """Finite float64 `positions` (n, 3), int64 `triangles` (m, 3), m > 0; TransferError names the first fault."""
    points, faces = as_points(f"{name} positions", positions), np.asarray(triangles)
    if faces.ndim != 2 or faces.shape[1] != 3 or not len(faces):
        raise TransferError(f"{name} triangles must have shape (m, 3) with m > 0, not {faces.shape}.")
    if faces.dtype.kind not in "iu":
        raise TransferError(f"{name} triangles must be whole numbers, not {faces.dtype}.")
    bad = np.flatnonzero(((faces < 0) | (faces >= len(points))).any(axis=1))
    if len(bad):
        row = faces[bad[0]].tolist()
        raise TransferError(f"{name} triangle {bad[0]} = {row} names a vertex outside 0..{len(points) - 1}.")
    return points, np.ascontiguousarray(faces, np.int64)


def as_points(name: str, positions: ArrayLike) -> Floats:
    """`positions` (n, 3) as finite C-contiguous float64; TransferError names the first bad row."""
    try:
        points = np.ascontiguousarray(positions, np.float64)
    except (TypeError, ValueError) as error:
        raise TransferError(f"{name} is not an array of numbers: {error}.") from error
    if points.ndim != 2 or points.shape[1] != 3:
        raise TransferError(f"{name} must have shape (n, 3), not {points.shape}.")
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if len(bad):
        raise TransferError(f"{name}[{bad[0]}] is {points[bad[0]].tolist()}, not finite.")
    return points


def edges_of(triangles: Ints) -> Ints:
    """Unique edges (e, 2), lower vertex first."""
    ends = triangles.astype(np.int64, copy=False)
    one, other = ends.ravel(), ends[:, [1, 2, 0]].ravel()
    low, high = np.minimum(one, other), np.maximum(one, other)
    n = int(high.max(initial=-1)) + 1
    keys = np.unique(low * n + high)  # sorts numbers, not rows: a fifth of the time
    return np.column_stack(np.divmod(keys, max(n, 1)))


def adjacency(edges: Ints, n_vertices: int) -> Sparse:
    """Symmetric vertex adjacency matrix, (n, n): 1 where two vertices share an edge."""
    i, j = edges.T
    ones = np.ones(2 * len(edges))
    return csr_array((ones, (np.concatenate([i, j]), np.concatenate([j, i]))), shape=(n_vertices, n_vertices))


def longest_edges(positions: Floats, edges: Ints) -> Floats:
    """Longest edge at each vertex, (n,) [m]; 0 at a vertex without one."""
    longest = np.zeros(len(positions))
    lengths = np.linalg.norm(positions[edges[:, 1]] - positions[edges[:, 0]], axis=1)
    for end in edges.T:
        np.maximum.at(longest, end, lengths)
    return longest


def triangle_normals(positions: Floats, triangles: Ints) -> Floats:
    """Unit normals of the triangles, (m, 3); zero where there is no area."""
    a, b, c = (positions[triangles[:, k]] for k in range(3))
    return unit(np.cross(b - a, c - a))


def vertex_normals(positions: Floats, triangles: Ints) -> Floats:
    """Unit normals at the vertices, (n, 3): the triangles' weighted by their angle there; zero where there is none.

    Baerentzen & Aanaes 2005: the weighting for which the sign of (p - v) . n separates outside from inside.
    """
    normals, summed = triangle_normals(positions, triangles), np.zeros_like(positions)
    for k in range(3):
        v, w, u = (triangles[:, (k + i) % 3] for i in range(3))
        cosine = (unit(positions[w] - positions[v]) * unit(positions[u] - positions[v])).sum(axis=1)
        np.add.at(summed, v, np.arccos(np.clip(cosine, -1, 1))[:, None] * normals)
    return unit(summed)


def convex_curvature(positions: Floats, triangles: Ints) -> Floats:
    """Largest convex normal curvature at each vertex [1/m], (n,), 0 where the surface is flat or concave.

    Of an edge: (n_j - n_i) . (x_j - x_i) / |x_j - x_i|^2, which is 1/r on a sphere; of a vertex the largest of its
    edges, then the mean with those of its neighbours, as vertex normals are noisy.
    """
    edges = edges_of(triangles)
    normals = vertex_normals(positions, triangles)
    along, turn = (array[edges[:, 1]] - array[edges[:, 0]] for array in (positions, normals))
    squared = (along**2).sum(axis=1)
    bent = np.divide((turn * along).sum(axis=1), squared, out=np.zeros(len(edges)), where=squared > 0)
    largest = np.zeros(len(positions))
    for end in edges.T:
        np.maximum.at(largest, end, bent)
    ring = adjacency(edges, len(positions))
    return np.asarray((largest + ring @ largest) / (1 + ring.sum(axis=1)))


def unit(vectors: Floats) -> Floats:
    """Unit vectors of `vectors` (k, 3); zero stays zero."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0)


def adjacent_triangles(triangles: Ints) -> Ints:
    """Pairs (p, 2) of triangles that share an edge, each once; an edge of k triangles gives a chain of k - 1."""
    count = len(triangles)
    edges = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    owner = np.tile(np.arange(count), 3)
    order = np.lexsort((owner, edges[:, 1], edges[:, 0]))
    edges, owner = edges[order], owner[order]
    same = (edges[1:] == edges[:-1]).all(axis=1)
    return np.column_stack([owner[:-1][same], owner[1:][same]])


def vertex_components(triangles: Ints, vertices: int) -> Ints:
    """Label (n,) of each vertex's connected component; -1 where no triangle uses the vertex."""
    _, labels = connected_components(adjacency(edges_of(triangles), vertices), directed=False)
    used = np.zeros(vertices, bool)
    used[triangles] = True
    numbers = np.full(vertices, -1, np.int64)
    numbers[used] = np.unique(labels[used], return_inverse=True)[1]
    return numbers


def largest_component(triangles: Ints, labels: Ints) -> int:
    """Label of the component with the most triangles."""
    return int(np.bincount(labels[triangles[:, 0]]).argmax())
