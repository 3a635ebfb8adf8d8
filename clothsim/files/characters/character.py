"""Character: a triangle mesh bound to a skeleton, posed by linear blend skinning."""

from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.files.characters.quaternions import to_matrices
from clothsim.files.characters.skeleton import Pose, Skeleton
from transfer.body_model import pose_feature, skinned


@dataclass(frozen=True)
class Character:
    """Mesh of n vertices bound to k joints of a skeleton of j.

    Attributes
    ----------
    positions : (n, 3) ndarray [m]
        Vertices of the bound mesh, its shape parameters applied.
    triangles : (m, 3) ndarray
    weights : (n, k) ndarray
        Skinning weights >= 0, rows of sum 1.
    skeleton : Skeleton
    joints : (k,) ndarray
        Joint of each column of `weights`.
    inverse_bind : (k, 4, 4) ndarray
        From the space of `positions` to that of each joint when it was bound.
    pose_directions : (n, 3, 9 (j - 1)) ndarray [m]
        Pose blend shapes of a body of the SMPL family; (n, 3, 0) where there are none.
    up : str
        Axis of its space that points up: "y" or "z".
    """

    positions: Floats
    triangles: Ints
    weights: Floats
    skeleton: Skeleton
    joints: Ints
    inverse_bind: Floats
    pose_directions: Floats
    up: str = "y"

    def vertices(self, pose: Pose) -> Floats:
        """Vertices of the posed character, (n, 3) [m]: sum_k w_k G_k B_k (p + B_p), B_k the inverse bind matrices."""
        matrices = self.matrices(pose)
        points = self.positions
        if self.pose_directions.shape[2]:
            points = points + self.pose_offsets(pose)
        return skinned(points, self.weights, matrices[:, :3, :3], matrices[:, :3, 3])

    def matrices(self, pose: Pose) -> Floats:
        """Transforms G_k B_k of `pose` from the space of `positions`, one for each column of weights, (k, 4, 4)."""
        return self.skeleton.transforms(pose)[self.joints] @ self.inverse_bind

    def pose_offsets(self, pose: Pose) -> Floats:
        """Offsets B_p of `pose`, (n, 3) [m]; zero where the character has no pose blend shapes."""
        if not self.pose_directions.shape[2]:
            return np.zeros_like(self.positions)
        return np.asarray(self.pose_directions @ pose_feature(to_matrices(pose.rotations)), np.float64)


def bound_at_rest(
    positions: Floats,
    triangles: Ints,
    weights: Floats,
    skeleton: Skeleton,
    up: str,
    pose_directions: Floats | None = None,
) -> Character:
    """Character bound to all joints of a skeleton whose axes at rest are those of the space, in its rest pose."""
    j = len(skeleton.names)
    inverse_bind = np.tile(np.eye(4), (j, 1, 1))
    inverse_bind[:, :3, 3] = -skeleton.rest_positions()
    none = np.zeros((len(positions), 3, 0))
    directions = none if pose_directions is None else pose_directions
    return Character(positions, triangles, weights, skeleton, np.arange(j), inverse_bind, directions, up)
