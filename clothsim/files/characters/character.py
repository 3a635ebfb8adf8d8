"""Characters: triangle meshes bound to a skeleton, posed by linear blend skinning.

The package's mannequin and body models of the SMPL family are such.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.files.characters.skeleton import Pose, Skeleton, skeleton_at, to_matrices
from clothsim.mesh.generators.mannequin.generator import (
    JOINTS,
    PARENTS,
    Proportions,
    template,
    warped,
    warped_joints,
)
from transfer.body_model import BodyModel, pose_feature, read_body_model, skinned
from transfer.errors import TransferError


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


SMPL_JOINTS = (
    "pelvis", "left_hip", "right_hip", "spine1", "left_knee", "right_knee", "spine2", "left_ankle", "right_ankle",
    "spine3", "left_foot", "right_foot", "neck", "left_collar", "right_collar", "head", "left_shoulder",
    "right_shoulder", "left_elbow", "right_elbow", "left_wrist", "right_wrist",
)  # fmt: skip
"""Names of the first 22 joints, which SMPL, SMPL-H and SMPL-X share."""


def mannequin_character(**measures: float) -> Character:
    """Mannequin of `measures` (height [m] and factors, see `mesh.generators.mannequin`) in its A-pose.

    Raises
    ------
    InputError
        For an unknown measure, or one out of its range.

    Examples
    --------
    >>> mannequin_character(height=1.8).skeleton.names[:3]
    ('pelvis', 'spine', 'chest')
    """
    known = [field.name for field in fields(Proportions)]
    unknown = [name for name in measures if name not in known]
    if unknown:
        raise InputError(f"The mannequin has no measure {unknown[0]!r}.", f"Known: {', '.join(known)}.")
    proportions, made = Proportions(**measures), template()
    positions = warped(made.positions, made.weights, proportions)
    skeleton = skeleton_at(JOINTS, PARENTS, warped_joints(proportions))
    return bound_at_rest(positions, made.triangles.copy(), made.weights.copy(), skeleton, "z")


def model_character(model: BodyModel, beta: ArrayLike = ()) -> Character:
    """Character of a body model of the SMPL family with shape parameters `beta`; InputError for bad ones."""
    try:
        shaped, joints = model.shaped(beta), model.joints(beta)
    except TransferError as error:
        raise InputError(f"shape: {error.sentence}", error.remedy) from error
    skeleton = skeleton_at(joint_names(len(model.parents)), model.parents, joints)
    return bound_at_rest(shaped, model.triangles, model.weights, skeleton, "y", model.pose_directions)


def smpl_character(path: Path, beta: Sequence[float] = ()) -> Character:
    """Character of a body model file (.npz with the keys of SMPL), y up.

    Raises
    ------
    InputError
        The file is missing, broken or pickled, or `beta` has too many numbers.
    """
    try:
        model = read_body_model(path)
    except TransferError as error:
        raise InputError(error.sentence, error.remedy) from error
    return model_character(model, beta)


def joint_names(count: int) -> tuple[str, ...]:
    """Names of the joints of a body model of the SMPL family with `count` joints."""
    known = SMPL_JOINTS if count >= len(SMPL_JOINTS) else ()
    return (*known, *(f"joint{j}" for j in range(len(known), count)))


def parents_of_smpl() -> Ints:
    """Parents of SMPL_JOINTS, (22,)."""
    return np.array([-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19], np.int64)
