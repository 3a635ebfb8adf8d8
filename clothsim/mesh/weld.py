"""Merging vertices: borders that lie close (panels of a garment), or all that lie at one place (an STL file)."""

import numpy as np

from clothsim.arrays import Floats, Ints, as_points, as_positive, as_triangles
from clothsim.errors import InputError
from clothsim.mesh.check import some
from clothsim.mesh.degenerate import coincidence
from clothsim.mesh.topology import border_vertices

MOST_PAIRS = 200
"""Close neighbours a border vertex may have on average: beyond it `distance` is no seam, and would fill the memory."""


def weld(positions: Floats, triangles: Ints, distance: float) -> tuple[Floats, Ints, Ints]:
    """Merge the border vertices that are closer than `distance` [m], and those joined through such pairs.

    Returns the positions (k, 3), each merged vertex at the mean of its parts, the triangles (m, 3) in the same order,
    so that arrays per triangle and corner stay valid, and the new number of every old vertex (n,). Inner vertices
    never move. InputError where a triangle would lose a corner, or `distance` takes in far more than a seam.
    """
    points = as_points("positions", positions)
    faces = as_triangles("triangles", triangles, len(points))
    reach = as_positive("weld", distance, zero=True)
    border = border_vertices(faces)
    label = np.arange(len(points))
    if reach > 0 and len(border):
        label[border] = border[_clusters(points[border], reach)]
    number = _renumber(label)
    welded = number[faces]
    lost = np.flatnonzero((welded == np.roll(welded, 1, axis=1)).any(axis=1))
    if len(lost):
        raise InputError(
            f"weld = {reach:g} m would collapse {some('triangle', lost)}.",
            "Choose it below the shortest edge on the border.",
        )
    count = np.bincount(number)
    merged = np.stack([np.bincount(number, weights=column) / count for column in points.T], axis=1)
    alone = count[number] == 1
    merged[number[alone]] = points[alone]
    return merged, welded, number


def merge_coincident(positions: Floats) -> tuple[Floats, Ints]:
    """One vertex for each place: positions (k, 3) in order of first appearance, and the number of each old one (n,)."""
    group, _ = coincidence(positions)
    _, first = np.unique(group, return_index=True)
    number = _renumber(first[group])
    merged = np.empty((len(first), 3))
    merged[number] = positions
    return merged, number


def _clusters(points: Floats, distance: float) -> Ints:
    """For each point the first of those it is joined to by steps below `distance`, (b,)."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    tree = cKDTree(points)
    if tree.count_neighbors(tree, distance) > (MOST_PAIRS + 1) * len(points):
        raise InputError(
            f"weld = {distance:g} m takes in more than {MOST_PAIRS} neighbours of each border vertex.",
            "Choose it smaller.",
        )
    pairs = tree.query_pairs(distance, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs), np.int8), (pairs[:, 0], pairs[:, 1])), shape=(len(points), len(points)))
    cluster = connected_components(graph, directed=False)[1]
    _, first, back = np.unique(cluster, return_index=True, return_inverse=True)
    return first[back]


def _renumber(label: Ints) -> Ints:
    """Labels, each the first vertex of its group, as numbers 0, 1, ... in that order."""
    return np.unique(label, return_inverse=True)[1].astype(np.int64)
