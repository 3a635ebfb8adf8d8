"""Parametric body model with linear blend skinning (Loper et al. 2015, SMPL; equations 2-11).

v = W(T + B_s(beta) + B_p(theta), J(beta), theta, weights): a template with blend shapes of the shape beta and of the
pose theta, skinned to joints that are regressed from the shaped mesh.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from transfer.errors import TransferError
from transfer.triangle_surface import Floats, Ints


@dataclass(frozen=True)
class BodyModel:
    """Body of n vertices, j joints and k shape parameters; made by `body_model` or `read_body_model`.

    Attributes
    ----------
    template : ndarray (n, 3)
        Vertices of the mean shape [m].
    triangles : ndarray (m, 3)
    shape_directions : ndarray (n, 3, k)
        Shape blend shapes [m per unit of beta].
    pose_directions : ndarray (n, 3, 9 (j - 1))
        Pose blend shapes [m].
    joint_regressor : ndarray (j, n)
        Rows of sum 1.
    weights : ndarray (n, j)
        Skinning weights >= 0, rows of sum 1.
    parents : ndarray (j,)
        Parent of each joint, listed before its children; -1 for the root.
    """

    template: Floats
    triangles: Ints
    shape_directions: Floats
    pose_directions: Floats
    joint_regressor: Floats
    weights: Floats
    parents: Ints

    def shaped(self, beta: ArrayLike = ()) -> Floats:
        """Shaped template T + B_s(beta), (n, 3) [m]; beta: up to k numbers, the others 0."""
        shape = _numbers("beta", beta)
        known = self.shape_directions.shape[2]
        if shape.ndim != 1 or len(shape) > known:
            raise TransferError(f"beta must be at most {known} numbers, not an array of shape {shape.shape}.")
        return np.asarray(self.template + self.shape_directions[:, :, : len(shape)] @ shape, np.float64)

    def joints(self, beta: ArrayLike = ()) -> Floats:
        """Joint positions J(beta) of the shaped body, (j, 3) [m]."""
        return np.asarray(self.joint_regressor @ self.shaped(beta), np.float64)

    def pose_offsets(self, theta: ArrayLike) -> Floats:
        """Pose offsets B_p(theta), (n, 3) [m], linear in flatten(R_j - I) of all joints but the root."""
        return np.asarray(self.pose_directions @ pose_feature(self._rotations(theta)), np.float64)

    def transforms(self, beta: ArrayLike, theta: ArrayLike) -> tuple[Floats, Floats]:
        """Rest-to-posed transform p -> R_j p + t_j of each joint: rotations (j, 3, 3), translations (j, 3) [m]."""
        return joint_transforms(self._rotations(theta), self.joints(beta), self.parents)

    def vertices(
        self, beta: ArrayLike = (), theta: ArrayLike | None = None, translation: ArrayLike = (0, 0, 0)
    ) -> Floats:
        """Vertices of the posed body.

        Parameters
        ----------
        beta : array_like (up to k,)
            Shape parameters; those left out are 0.
        theta : array_like (j, 3), optional
            Rotation vector of each joint relative to its parent [rad]; None: all zero.
        translation : array_like (3,)
            Added to every vertex [m].

        Returns
        -------
        ndarray (n, 3)
            Positions [m].

        Raises
        ------
        TransferError
            A parameter has another shape or a value that is not finite.
        """
        move = _numbers("translation", translation)
        if move.shape != (3,):
            raise TransferError(f"translation must be 3 numbers, not an array of shape {move.shape}.")
        if theta is None:
            return self.shaped(beta) + move
        rest = self.shaped(beta) + self.pose_offsets(theta)
        return skinned(rest, self.weights, *self.transforms(beta, theta)) + move

    def _rotations(self, theta: ArrayLike) -> Floats:
        pose = _numbers("theta", theta)
        if pose.shape != (len(self.parents), 3):
            raise TransferError(f"theta must have shape ({len(self.parents)}, 3), not {pose.shape}.")
        return rotation_matrices(pose)


def rotation_matrices(rotation_vectors: Floats) -> Floats:
    """Rotation matrices (j, 3, 3) of rotation vectors (j, 3) [rad], by Rodrigues' formula."""
    angles = np.linalg.norm(rotation_vectors, axis=1)
    axes = rotation_vectors / np.where(angles > 0, angles, 1.0)[:, None]
    cross = np.cross(np.eye(3), axes[:, None, :])
    sine, cosine = np.sin(angles)[:, None, None], np.cos(angles)[:, None, None]
    return np.asarray(np.eye(3) + sine * cross + (1 - cosine) * (cross @ cross), np.float64)


def pose_feature(rotations: Floats) -> Floats:
    """Pose feature flatten(R_j - I) of the rotations (j, 3, 3) of all joints but the root, row by row, (9 (j - 1),)."""
    return np.asarray((rotations[1:] - np.eye(3)).ravel(), np.float64)


def joint_transforms(rotations: Floats, joints: Floats, parents: Ints) -> tuple[Floats, Floats]:
    """Forward kinematics about the rest joints (j, 3): rotations (j, 3, 3), translations (j, 3)."""
    turns, moves = rotations.copy(), np.zeros_like(joints)
    for j, parent in enumerate(parents):
        own = joints[j] - rotations[j] @ joints[j]
        if parent < 0:
            moves[j] = own
        else:
            turns[j] = turns[parent] @ rotations[j]
            moves[j] = turns[parent] @ own + moves[parent]
    return turns, moves


def skinned(points: Floats, weights: Floats, rotations: Floats, translations: Floats) -> Floats:
    """Linear blend skinning: sum_j w_j (R_j p + t_j) of `points (n, 3)` with `weights (n, j)`."""
    blended = np.tensordot(weights, rotations, axes=1)
    return np.asarray(np.einsum("nkl,nl->nk", blended, points) + weights @ translations, np.float64)


def _numbers(name: str, values: ArrayLike) -> Floats:
    try:
        numbers = np.asarray(values, np.float64)
    except (ValueError, TypeError) as error:
        raise TransferError(f"{name} must be numbers: {error}.") from error
    if not np.isfinite(numbers).all():
        raise TransferError(f"{name} holds a number that is not finite.")
    return numbers
