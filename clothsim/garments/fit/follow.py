"""Pieces that follow another: positions in the frames of its triangles, or rigid."""

from dataclasses import dataclass, replace

import numpy as np

from clothsim.base.arrays import Floats, Ints


@dataclass(frozen=True)
class Followers:
    """A piece bound to triangles of its host.

    Parameters
    ----------
    vertices : (k,) int64
        Its vertices in the whole garment.
    corners : (k, 3) int64
        Triangle of the host of each, as rows of the simulated positions.
    weights : (k, 3) float64
        Barycentric coordinates of the closest point.
    offsets : (k, 3) float64
        Vector from there in the frame of the triangle [m].
    shape : (k, 3) or (0, 3) float64
        Rest shape of a piece that stays rigid [m].
    """

    vertices: Ints
    corners: Ints
    weights: Floats
    offsets: Floats
    shape: Floats

    def on_one_side(self, clearance: float) -> "Followers":
        """A copy whose vertices are all on the side of the host on which most are, `clearance` [m] from it at least."""
        height = self.offsets[:, 2]
        side = -1.0 if np.count_nonzero(height < 0) > len(height) / 2 else 1.0
        moved = self.offsets.copy()
        moved[:, 2] = side * np.maximum(side * height, clearance)
        return replace(self, offsets=moved)

    def at(self, positions: Floats) -> Floats:
        """Return the positions (k, 3) on the host at `positions (n, 3)` [m]."""
        points = np.einsum("ij,ijk->ik", self.weights, positions[self.corners])
        free = points + np.einsum("ijk,ij->ik", _frames(positions[self.corners]), self.offsets)
        return _rigidly(self.shape, free) if len(self.shape) else free


def followers_of(
    whole: Floats, own: Ints, corners: Ints, simulated: Ints, closest: Floats, is_rigid: bool
) -> Followers:
    """Return the vertices `own` of the `whole` (n, 3) bound to triangles `corners` (k, 3) of the `simulated` vertices.

    closest (k, 3): their closest points there [m].
    """
    triangles = whole[simulated][corners]
    weights = _barycentric(triangles, closest)
    points = np.einsum("ij,ijk->ik", weights, triangles)
    offsets = np.einsum("ijk,ik->ij", _frames(triangles), whole[own] - points)
    return Followers(own, corners, weights, offsets, whole[own] if is_rigid else np.zeros((0, 3)))


def completed(positions: Floats, vertices: Ints, followers: tuple[Followers, ...]) -> Floats:
    """Return the positions of the whole garment, of its simulated `vertices` at `positions` and of the followers."""
    size = max([vertices.max(initial=-1), *(piece.vertices.max() for piece in followers)]) + 1
    whole = np.zeros((size, 3))
    whole[vertices] = positions
    for piece in followers:
        whole[piece.vertices] = piece.at(positions)
    return whole


def _frames(corners: Floats) -> Floats:
    """Orthonormal frames (k, 3, 3) of triangles (k, 3, 3), in rows: along the first edge, in the plane, normal."""
    along = corners[:, 1] - corners[:, 0]
    normal = np.cross(along, corners[:, 2] - corners[:, 0])
    along, normal = (v / np.maximum(np.linalg.norm(v, axis=1, keepdims=True), 1e-300) for v in (along, normal))
    return np.stack([along, np.cross(normal, along), normal], axis=1)


def _barycentric(triangles: Floats, points: Floats) -> Floats:
    """Barycentric coordinates (k, 3) of points in the planes of triangles."""
    e1, e2, r = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0], points - triangles[:, 0]
    a, b, c = (np.einsum("ij,ij->i", *pair) for pair in ((e1, e1), (e1, e2), (e2, e2)))
    p, q = np.einsum("ij,ij->i", r, e1), np.einsum("ij,ij->i", r, e2)
    determinant = np.maximum(a * c - b * b, 1e-300)
    v, w = (c * p - b * q) / determinant, (a * q - b * p) / determinant
    return np.column_stack([1 - v - w, v, w])


def _rigidly(shape: Floats, targets: Floats) -> Floats:
    """The shape (k, 3) moved rigidly onto the targets (Kabsch 1976)."""
    middle, goal = shape.mean(axis=0), targets.mean(axis=0)
    U, _, Vt = np.linalg.svd((shape - middle).T @ (targets - goal))
    sign = np.sign(np.linalg.det(U @ Vt))
    return (shape - middle) @ (U * [1, 1, sign]) @ Vt + goal
