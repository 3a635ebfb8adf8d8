"""Degenerate and duplicate triangles, and coincident vertices, in whole arrays."""

import numpy as np

from clothsim.base.arrays import Floats, Ints


def flat_triangles(positions: Floats, triangles: Ints) -> Ints:
    """Find the triangles without area, (k,): needles of zero length and collinear corners.

    |e1 x e2| <= 1e-14 L^2 + 4 ulp(|x|) L with L the longest edge: no absolute length, so millimetres and kilometres are
    treated alike, and far from the origin a triangle that is only round-off is degenerate. Slivers of aspect ratio 1e7
    are not.
    """
    corners = positions[triangles]
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        edge1, edge2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        longest = np.abs(np.stack([edge1, edge2, edge2 - edge1])).max(axis=(0, 2))
        sine = np.linalg.norm(np.cross(edge1 / longest[:, None], edge2 / longest[:, None]), axis=1)
        noise = 4 * np.finfo(float).eps * np.abs(corners).max(axis=(1, 2)) / longest
        return np.flatnonzero(~(sine > 1e-14 + noise))


def duplicates(triangles: Ints) -> tuple[Ints, Ints]:
    """Find the triangles that repeat an earlier one, with the same and with the opposite winding: two sorted (k,)."""
    smallest = np.argmin(triangles, axis=1)
    rolled = np.take_along_axis(triangles, (smallest[:, None] + np.arange(3)) % 3, axis=1)
    odd = rolled[:, 1] > rolled[:, 2]
    low, high = rolled[:, 1:].min(axis=1), rolled[:, 1:].max(axis=1)
    order = np.lexsort((high, low, rolled[:, 0]))
    key = np.column_stack([rolled[:, 0], low, high])[order]
    new = np.ones(len(order), bool)
    new[1:] = (key[1:] != key[:-1]).any(axis=1)
    original = order[new][np.cumsum(new) - 1]
    repeats, original = order[~new], original[~new]
    same = odd[repeats] == odd[original]
    return np.sort(repeats[same]), np.sort(repeats[~same])


def coincidence(positions: Floats) -> tuple[Ints, Ints]:
    """Group vertices by position (exactly equal): the group of each vertex (n,) and the size of that group (n,)."""
    order = np.lexsort(positions.T)
    new = np.ones(len(order), bool)
    new[1:] = (positions[order[1:]] != positions[order[:-1]]).any(axis=1)
    group = np.empty(len(order), np.int64)
    group[order] = np.cumsum(new) - 1
    return group, np.bincount(group)[group]
