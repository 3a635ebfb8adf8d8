"""Welding of vertices: borders closer than a distance (panels of a garment), or all coincident ones (an STL file)."""

import numpy as np

from clothsim.base.arrays import Floats, Ints, as_points, as_positive, as_triangles
from clothsim.base.errors import InputError
from clothsim.mesh.topology import border_vertices, coincidence, duplicates, vertex_rings

MOST_PAIRS = 200
"""Bound on the mean number of close neighbours of a border vertex: beyond it memory would be exhausted."""
WIDEST = 0.25
"""Largest distance of a seam, as a fraction of the mesh's extent: beyond it opposite borders are sewn together."""


def weld(positions: Floats, triangles: Ints, distance: float) -> tuple[Floats, Ints, Ints]:
    """Merge border vertices that are closer than `distance`, the closest pairs first.

    Inner vertices never move, and vertices joined by an edge are never merged, so no triangle collapses. Panels in
    three layers make fins, which the mesh checks report; two corners sewn on all sides make flaps, see `flaps`.

    Parameters
    ----------
    positions : (n, 3) array_like
        Vertices [m].
    triangles : (m, 3) array_like
        Vertex indices.
    distance : float
        [m].

    Returns
    -------
    positions : (k, 3) float64
        Each merged vertex at the mean of its parts.
    triangles : (m, 3) int64
        In the same order, so that arrays per triangle and corner stay valid.
    number : (n,) int64
        New number of every old vertex.

    Raises
    ------
    InputError
        Where `distance` joins far more than a seam, or is wider than a quarter of the mesh.
    """
    points = as_points("positions", positions)
    faces = as_triangles("triangles", triangles, len(points))
    limit = as_positive("weld", distance, zero=True)
    border = border_vertices(faces)
    label = np.arange(len(points))
    extent = float(np.ptp(points, axis=0).max(initial=0.0)) if len(points) else 0.0
    if len(border) and limit > WIDEST * extent:
        raise InputError(
            f"weld = {limit:g} m is more than a quarter of the mesh, which is {extent:.3g} m long.",
            "Set it to a little more than the gap between the borders.",
        )
    if limit > 0 and len(border):
        from scipy.spatial import cKDTree

        tree = cKDTree(points[border])
        if tree.count_neighbors(tree, limit) > (MOST_PAIRS + 1) * len(border):
            raise InputError(
                f"weld = {limit:g} m joins more than {MOST_PAIRS} neighbours of each border vertex.",
                "Set a smaller weld.",
            )
        pairs = border[tree.query_pairs(limit, output_type="ndarray")]
        apart = np.linalg.norm(points[pairs[:, 0]] - points[pairs[:, 1]], axis=1)
        starts, neighbours = vertex_rings(faces, len(points))
        members = {int(v): {int(v)} for v in np.unique(pairs)}
        rings = {v: set(neighbours[starts[v] : starts[v + 1]].tolist()) for v in members}
        for one, two in pairs[np.argsort(apart, kind="stable")].tolist():
            first, second = sorted((int(label[one]), int(label[two])))
            if first == second or rings[first] & members[second]:
                continue
            label[list(members[second])] = first  # a group is named by its first member
            members[first] |= members.pop(second)
            rings[first] |= rings.pop(second)
    number = _renumber(label)
    return mean_of_parts(points, number), number[faces], number


def mean_of_parts(points: Floats, number: Ints) -> Floats:
    """Return the mean of the rows of `points (n, 3)` by `number (n,)`, (k, 3); single rows keep their bits."""
    count = np.bincount(number)
    merged = np.stack([np.bincount(number, weights=column) / count for column in points.T], axis=1)
    alone = count[number] == 1
    merged[number[alone]] = points[alone]
    return merged


def flaps(triangles: Ints) -> Ints:
    """Return the triangles that coincide with another one with the opposite winding, (k,).

    Where a seam turns the corner of a panel, the corner triangles of both panels are sewn on all three sides: a pocket
    without volume. Its hinges would be folded by 180 degrees and never flatten; without it, the panels join along the
    third side.
    """
    same, flipped = duplicates(triangles)
    corners = np.sort(triangles, axis=1)
    _, group = np.unique(corners, axis=0, return_inverse=True)
    group = group.ravel()
    return np.flatnonzero(np.isin(group, group[flipped]) & ~np.isin(group, group[same]))


def merge_coincident(positions: Floats) -> tuple[Floats, Ints]:
    """Merge coincident vertices: positions (k, 3) by first appearance, and the new number of each old one (n,)."""
    group, _ = coincidence(positions)
    _, first = np.unique(group, return_index=True)
    number = _renumber(first[group])
    merged = np.empty((len(first), 3))
    merged[number] = positions
    return merged, number


def _renumber(label: Ints) -> Ints:
    """Labels, each the first vertex of its group, as numbers 0, 1, ... in that order."""
    return np.unique(label, return_inverse=True)[1].astype(np.int64)
