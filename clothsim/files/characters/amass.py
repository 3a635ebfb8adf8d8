"""Motion files of AMASS (.npz): axis-angle poses of a body model of the SMPL family."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.base.file_reading import read_arrays
from clothsim.files.characters.clip import Clip, uniform_clip
from clothsim.files.characters.known_bodies import SMPL_JOINTS, parents_of_smpl
from clothsim.files.characters.quaternions import from_rotation_vectors, product, to_matrices
from clothsim.files.characters.skeleton import Skeleton, skeleton_at

RATES = ("mocap_framerate", "mocap_frame_rate", "fps")
MOST_FRAMES = 1_000_000
_T_POSE = {
    "pelvis": (0, 0, 0), "spine1": (0, 0.11, 0), "spine2": (0, 0.24, 0), "spine3": (0, 0.3, 0),
    "neck": (0, 0.5, 0), "head": (0, 0.6, 0), "hip": (0.08, -0.08, 0), "knee": (0.08, -0.46, 0),
    "ankle": (0.08, -0.86, 0), "foot": (0.08, -0.92, 0.12), "collar": (0.06, 0.4, 0), "shoulder": (0.18, 0.44, 0),
    "elbow": (0.44, 0.44, 0), "wrist": (0.69, 0.44, 0),
}  # fmt: skip
"""An upright T of an adult [m], y up, left at +x: directions of the bones are all that retargeting takes of it."""


def t_pose() -> Skeleton:
    """Skeleton of the 22 joints that bodies of the SMPL family share, in a T."""
    positions = []
    for name in SMPL_JOINTS:
        side = -1.0 if name.startswith("right_") else 1.0
        x, y, z = _T_POSE[name.removeprefix("left_").removeprefix("right_")]
        positions.append((side * x, y, z))
    return skeleton_at(SMPL_JOINTS, parents_of_smpl(), np.array(positions, np.float64))


def read_amass(path: Path, skeleton: Skeleton | None = None) -> Clip:
    """Read an AMASS motion, turned to y up where it is z up.

    Parameters
    ----------
    path : Path
        poses (F, 3 j) [rad], trans (F, 3) [m] and mocap_framerate [1/s]; other keys are not read. Joints are those of
        SMPL (72 numbers), SMPL-H (156) or SMPL-X (165).
    skeleton : Skeleton, optional
        Of the body model that moves; None: a T of the 22 joints that all have. Of a model with another number of joints
        than the motion, the first 22 are moved.

    Raises
    ------
    InputError
        The file is missing, broken or pickled, or lacks a key.
    """
    arrays = read_arrays(path, ["poses", "trans", *RATES])
    for name in ("poses", "trans"):
        if name not in arrays:
            raise InputError(f"{path.name} has no {name!r}.", "An AMASS motion has poses, trans and mocap_framerate.")
    rate = next((arrays[name] for name in RATES if name in arrays), np.array(np.nan))
    if rate.size != 1 or not 0 < float(rate.ravel()[0]) < 1e5:
        raise InputError(f"{path.name} has no frame rate.", "Save mocap_framerate with it.")
    poses, trans = _frames(path, arrays["poses"], arrays["trans"])
    body = t_pose() if skeleton is None else skeleton
    known, moved = poses.shape[1], len(body.names)
    count = moved if known == moved else min(len(SMPL_JOINTS), known, moved)
    rotations = np.tile([1.0, 0.0, 0.0, 0.0], (len(poses), moved, 1))
    rotations[:, :count] = from_rotation_vectors(poses[:, :count])
    root = body.rest.translations[0] + trans
    # a body model has y up, AMASS's roots turn it to z up
    ups = to_matrices(rotations[:, 0])[:, :, 1].mean(axis=0)
    quarter = np.array([-np.pi / 2, 0.0, 0.0]) if ups[2] > abs(ups[1]) else np.zeros(3)
    turn = from_rotation_vectors(quarter)
    rotations[:, 0] = product(np.broadcast_to(turn, (len(poses), 4)), rotations[:, 0])
    return uniform_clip(path.name, body, float(rate.ravel()[0]), rotations, root @ to_matrices(turn).T)


def _frames(path: Path, poses: NDArray, trans: NDArray) -> tuple[Floats, Floats]:
    if poses.ndim != 2 or poses.shape[1] % 3 or poses.shape[1] < 3 * len(SMPL_JOINTS) or not len(poses):
        raise InputError(f"poses of {path.name} has shape {poses.shape}.", "It has 72, 156 or 165 numbers a frame.")
    if trans.shape != (len(poses), 3):
        raise InputError(f"trans of {path.name} has shape {trans.shape}, not ({len(poses)}, 3).")
    if len(poses) > MOST_FRAMES:
        raise InputError(f"{path.name} has {len(poses):,} frames, more than {MOST_FRAMES:,}.", "Cut it.")
    for name, values in (("poses", poses), ("trans", trans)):
        bad = np.argwhere(~np.isfinite(values))
        if len(bad):
            raise InputError(f"{name} of {path.name}: frame {bad[0, 0]} is not finite.", "Repair it.")
    return poses.astype(np.float64).reshape(len(poses), -1, 3), trans.astype(np.float64)
