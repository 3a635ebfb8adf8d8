"""Positions that a garment has on the target body where it keeps its place on the body that it was made for."""

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.garments.fit.deflate import smoothed
from transfer.signed_distance import BodySurface, barycentric


def worn_positions(garment: Floats, source: BodySurface, moved: Floats) -> Floats:
    """Garment positions carried from one body to another with the points of the body below them, (n, 3) [m].

    Each vertex keeps its offset from the closest point of the body, turned as the body is turned there.

    Parameters
    ----------
    garment : (n, 3) ndarray
        Positions on the source body [m].
    source : BodySurface
        Body that the garment was made for.
    moved : (k, 3) ndarray
        Its vertices in the shape and pose of the other body [m].
    """
    below = source.closest(garment)
    corners = source.triangles[below.triangles]
    weights = barycentric(source.positions[corners], below.points)
    turn = _rotations(source, moved)[corners]
    turned = np.einsum("nk,nkij,nj->ni", weights, turn, garment - below.points)
    return np.asarray(np.einsum("nk,nkj->nj", weights, moved[corners]) + turned, np.float64)


def _rotations(source: BodySurface, moved: Floats) -> Floats:
    """Rotations of the body's surface at its vertices, (k, 3, 3): polar factors of smoothed deformation gradients."""
    before, after = _frames(source.positions[source.triangles]), _frames(moved[source.triangles])
    gradients = after @ np.linalg.pinv(before)
    count = len(source.positions)
    of_vertex = np.zeros((count, 3, 3))
    np.add.at(of_vertex, source.triangles, gradients[:, None])
    smooth = smoothed(of_vertex.reshape(count, 9), source.triangles)
    left, _, right = np.linalg.svd(smooth.reshape(count, 3, 3))
    left[:, :, 2] *= np.sign(np.linalg.det(left @ right))[:, None]
    return left @ right


def _frames(corners: Floats) -> Floats:
    """Two edges and the unit normal of triangles (m, 3, 3), as columns."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(a, b)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    return np.stack([a, b, normal / np.where(length > 0, length, 1.0)], axis=2)
