"""Retargeting of a motion to another skeleton by the roles of joints."""

from dataclasses import dataclass, replace

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.files.characters.clip import Clip
from clothsim.files.characters.skeleton import Pose, Skeleton, from_matrices, joint_roles, orthonormal, to_matrices
from clothsim.mesh.body import rotation_matrix

SNAP_DEGREES = 20.0
"""A frame of a skeleton within this angle of the axes is taken as them: rest poses lean a little."""
NEXT = {"shoulder": "elbow", "elbow": "wrist", "hip": "knee", "knee": "ankle"}
"""The joint at the other end of the bone of a limb."""
NEEDED = ("pelvis", "left_hip", "right_hip", "left_knee", "right_knee", "left_shoulder", "right_shoulder")
"""Roles that both skeletons need."""
SAMPLES = 60
"""Times of a clip at which its lowest foot is looked for."""


@dataclass(frozen=True)
class Retargeted:
    """Motion of a clip on another skeleton.

    Attributes
    ----------
    clip : Clip
    skeleton : Skeleton
        The target.
    pairs : dict of int to int
        Joint of the clip by joint of the target.
    corrections : (j, 3, 3) ndarray
        From the bone of the target at rest to that of the clip at rest, in the axes of the target.
    axes : (3, 3) ndarray
        From the space of the clip to that of the target.
    scale : float
        Metres of the target for a unit of the clip.
    pelvis : tuple of int
        Joint of the target, and of the clip.
    lift : float
        Displacement upwards that puts the lowest foot where it is at rest [m].
    up : (3,) ndarray
        Up in the target's space.
    """

    clip: Clip
    skeleton: Skeleton
    pairs: dict[int, int]
    corrections: Floats
    axes: Floats
    scale: float
    pelvis: tuple[int, int]
    lift: float
    up: Floats

    @property
    def duration(self) -> float:
        """Time of the last key frame [s]."""
        return self.clip.duration

    def pose(self, time: float) -> Pose:
        """Pose of the target at `time` [s].

        A joint with a partner turns in space as that does from its rest, R = A D A' C R_rest; another one turns with
        its parent.
        """
        source, rest = self.clip.skeleton, self.skeleton.rest
        moved = source.transforms(self.clip.pose(time))
        turned = self.axes @ orthonormal(moved[:, :3, :3]) @ np.swapaxes(source.rest_axes(), -1, -2) @ self.axes.T
        local, own = to_matrices(rest.rotations), self.skeleton.rest_axes()
        world = np.zeros_like(own)
        for j, parent in enumerate(self.skeleton.parents):
            before = world[parent] if parent >= 0 else np.eye(3)
            paired = j in self.pairs
            world[j] = turned[self.pairs[j]] @ self.corrections[j] @ own[j] if paired else before @ local[j]
            local[j] = before.T @ world[j]
        translations = rest.translations.copy()
        j, k = self.pelvis
        offset = moved[k, :3, 3] - source.rest_positions()[k]
        place = self.skeleton.rest_positions()[j] + self.scale * self.axes @ offset + self.lift * self.up
        parent = self.skeleton.parents[j]
        if parent >= 0:
            place = np.linalg.solve(self.skeleton.transforms(rest)[parent], [*place, 1.0])[:3]
        translations[j] = place
        return Pose(translations, from_matrices(local), rest.scales)


def retargeted(clip: Clip, target: Skeleton, scale: float | None = None) -> Retargeted:
    """Retarget a clip to a skeleton, joint by joint of the same role.

    Parameters
    ----------
    clip : Clip
        Any unit and axes; both skeletons stand upright at rest.
    target : Skeleton
    scale : float, optional
        Metres for a unit of the clip; None: the ratio of the lengths of the legs.

    Raises
    ------
    InputError
        One of the skeletons lacks the hips, legs or arms.
    """
    source = clip.skeleton
    roles = [joint_roles(skeleton.names, skeleton.parents.tolist()) for skeleton in (source, target)]
    for what, skeleton, known in zip(
        (f"The motion {clip.name}", "The character"), (source, target), roles, strict=True
    ):
        lacking = [role for role in NEEDED if role not in known]
        if lacking:
            names = ", ".join(skeleton.names[:12])
            raise InputError(
                f"{what} has no joint for {lacking[0]}.", f"Its joints: {names} ... Rename them as Mixamo does."
            )
    here, there = (skeleton.rest_positions() for skeleton in (target, source))
    axes = body_axes(here, roles[1]) @ body_axes(there, roles[0]).T
    corrections = np.tile(np.eye(3), (len(target.names), 1, 1))
    for role, j in roles[1].items():
        side, _, joint = role.rpartition("_")
        other = f"{side}_{NEXT.get(joint, '')}"
        if all(other in known and role in known for known in roles):
            # the turn by the smallest angle that takes the direction of the one bone to that of the other
            start, end = here[roles[1][other]] - here[j], axes @ (there[roles[0][other]] - there[roles[0][role]])
            axis = np.cross(start, end)
            length = float(np.linalg.norm(axis))
            angle = float(np.arctan2(length, start @ end))
            corrections[j] = rotation_matrix(axis * (angle / length)) if length > 1e-12 else np.eye(3)
    for side in ("left", "right"):  # a hand goes on along its forearm
        if {f"{side}_wrist", f"{side}_elbow"} <= roles[1].keys():
            corrections[roles[1][f"{side}_wrist"]] = corrections[roles[1][f"{side}_elbow"]]
    ratio = leg_length(here, roles[1]) / leg_length(there, roles[0]) if scale is None else scale
    pairs = {j: roles[0][role] for role, j in roles[1].items() if role in roles[0]}
    pelvis, up = (roles[1]["pelvis"], roles[0]["pelvis"]), body_axes(here, roles[1])[:, 1]
    level = Retargeted(clip, target, pairs, corrections, axes, ratio, pelvis, 0.0, up)
    # the lift puts the lowest foot of the clip where the lower foot is at rest [m]
    feet = [roles[1].get(f"{side}_ankle", roles[1][f"{side}_knee"]) for side in ("left", "right")]
    times = np.linspace(0, level.duration, SAMPLES if level.duration else 1)
    heights = [level.skeleton.transforms(level.pose(t))[feet, :3, 3] @ level.up for t in times]
    return replace(level, lift=float((level.skeleton.rest_positions()[feet] @ level.up).min() - np.min(heights)))


def body_axes(positions: Floats, roles: dict[str, int]) -> Floats:
    """Left, up and front of a skeleton at rest, as columns (3, 3)."""
    at = {role: positions[row] for role, row in roles.items()}
    up = at["left_shoulder"] + at["right_shoulder"] - at["left_hip"] - at["right_hip"]
    left = at["left_hip"] - at["right_hip"]
    up = up / max(float(np.linalg.norm(up)), 1e-12)
    left = left - (left @ up) * up
    left = left / max(float(np.linalg.norm(left)), 1e-12)
    frame = np.stack([left, up, np.cross(left, up)], axis=1)
    snapped = np.round(frame)
    turn = 0.5 * (np.trace(snapped.T @ frame) - 1)
    proper = np.allclose(snapped.T @ snapped, np.eye(3)) and turn > np.cos(np.radians(SNAP_DEGREES))
    return snapped if proper else frame


def leg_length(positions: Floats, roles: dict[str, int]) -> float:
    """Length of the thigh, the mean of both sides, in units of `positions`."""
    lengths = [
        np.linalg.norm(positions[roles[f"{side}_hip"]] - positions[roles[f"{side}_knee"]]) for side in ("left", "right")
    ]
    return max(float(np.mean(lengths)), 1e-12)
