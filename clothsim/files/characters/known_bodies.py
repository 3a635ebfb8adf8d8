"""Characters of the package's mannequin and of body models of the SMPL family."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from clothsim.base.arrays import Ints
from clothsim.base.errors import InputError
from clothsim.files.characters.character import Character, bound_at_rest
from clothsim.files.characters.skeleton import skeleton_at
from clothsim.mesh.generators.mannequin.generator import template
from clothsim.mesh.generators.mannequin.proportions import RANGES, Proportions, warped, warped_joints
from clothsim.mesh.generators.mannequin.skeleton import JOINTS, PARENTS
from transfer.body_file import read_body_model
from transfer.body_model import BodyModel
from transfer.errors import TransferError

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
    unknown = [name for name in measures if name not in RANGES]
    if unknown:
        raise InputError(f"The mannequin has no measure {unknown[0]!r}.", f"Known: {', '.join(RANGES)}.")
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
