"""Triangle adjacency and connected components of a mesh."""

import numpy as np
from scipy.sparse.csgraph import connected_components

from transfer.triangle_surface import Ints, adjacency, edges_of


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
