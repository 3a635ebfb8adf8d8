"""Skeleton: a hierarchy of joints with their transforms at rest, forward kinematics, and the roles of joints.

Roles are known by the names of Mixamo, CMU, SMPL, Blender, Unreal and the mannequin.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.files.characters.quaternions import from_matrices, from_rotation_vectors, to_matrices

LIMBS = ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")
"""Joints of an arm and of a leg, each on both sides."""
_WORDS = {
    "pelvis": ("pelvis", "hips", "root", "bip01", "bip001"),
    "neck": ("neck", "neck1", "neck01"),
    "head": ("head",),
    "shoulder": ("arm", "upperarm", "uparm", "shoulder"),
    "elbow": ("forearm", "lowerarm", "lowarm", "elbow"),
    "wrist": ("hand", "wrist"),
    "hip": ("upleg", "upperleg", "thigh", "hip"),
    "knee": ("leg", "lowerleg", "shin", "calf", "knee"),
    "ankle": ("foot", "ankle"),
}
_FILLERS = ("j", "c", "bip")
"""Words of VRM's and Biped's names that say nothing."""
_ROLE_OF = {word: role for role, words in _WORDS.items() for word in words}
_SPINE = re.compile(r"(?:spine|chest|lowerback|upperchest|abdomen|torso)\d*")


def joint_roles(names: Sequence[str], parents: Sequence[int]) -> dict[str, int]:
    """Row of each role that a skeleton has: "pelvis", "spine", "chest", "neck", "head" and "left_elbow" and its likes.

    Parameters
    ----------
    names : sequence of str
        Names of the joints: "mixamorig:LeftForeArm", "forearm.L", "lowerarm_l", "left_elbow" are one role.
    parents : sequence of int
        Parent of each joint, listed before it.

    Examples
    --------
    >>> joint_roles(["mixamorig:Hips", "mixamorig:LeftUpLeg", "mixamorig:LeftLeg"], [-1, 0, 1])
    {'pelvis': 0, 'left_hip': 1, 'left_knee': 2}
    """
    found: dict[str, int] = {}
    spines: list[int] = []
    for row, name in enumerate(names):
        side, word = _split(name)
        role = _ROLE_OF.get(word, "")
        if side and role in LIMBS:
            found.setdefault(f"{side}_{role}", row)
            if role == "shoulder" and word != "shoulder":  # beside an upper arm, "shoulder" is the collar bone
                found[f"{side}_shoulder"] = row
        elif not side and _SPINE.fullmatch(word):
            spines.append(row)
        elif not side and role and role not in LIMBS:
            if role == "pelvis" and role in found and parents[row] != found[role]:
                continue
            if role != "pelvis" or word != "root" or role not in found:
                found[role] = row
    if "pelvis" not in found and spines:  # Blender's basic rig: its first spine bone is the pelvis
        found["pelvis"] = spines.pop(0)
    if spines:
        found["spine"] = spines[0]
        above = _ancestors(found.get("left_shoulder", -1), parents)
        chests = [row for row in spines[1:] if row in above or "left_shoulder" not in found]
        if chests:
            found["chest"] = chests[-1]
    return found


def _ancestors(row: int, parents: Sequence[int]) -> set[int]:
    found = set()
    while row >= 0:
        row = parents[row]
        found.add(row)
    return found


def _split(name: str) -> tuple[str, str]:
    """Side ("left", "right" or "") and bare word of a joint's name."""
    bare = re.split(r"[:|]", name)[-1]
    bare = re.sub(r"^(mixamorig\d*|bip0*1|def|org|character\d*|valvebiped)[_\-. ]+(?=\w)", "", bare, flags=re.I)
    bare = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", bare)
    words = [word for word in re.split(r"[\s_.\-]+", bare) if word]
    side = ""
    kept = []
    for low in map(str.lower, words):
        if low in _FILLERS:
            continue
        if not side and low in ("left", "l", "right", "r"):
            side = "left" if low[0] == "l" else "right"
        else:
            kept.append(low)
    joined = "".join(kept)
    for start in ("left", "right"):
        if not side and joined.startswith(start):
            side, joined = start, joined.removeprefix(start)
    return side, re.sub(r"(?:joint|bone|jnt)$", "", joined) or joined


@dataclass(frozen=True)
class Pose:
    """Transform of each of j joints relative to its parent: p -> R S p + t.

    Attributes
    ----------
    translations : (j, 3) ndarray [m]
    rotations : (j, 4) ndarray
        Unit quaternions (w, x, y, z).
    scales : (j, 3) ndarray
    """

    translations: Floats
    rotations: Floats
    scales: Floats


@dataclass(frozen=True)
class Skeleton:
    """Joints, each listed after its parent.

    Attributes
    ----------
    names : tuple of str
    parents : (j,) ndarray
        -1 for a root.
    rest : Pose
        Pose in which the mesh was bound to the joints.
    """

    names: tuple[str, ...]
    parents: Ints
    rest: Pose

    def transforms(self, pose: Pose) -> Floats:
        """Transform of each joint to the space of the character, (j, 4, 4): forward kinematics."""
        local = np.zeros((len(self.names), 4, 4))
        local[:, :3, :3] = to_matrices(pose.rotations) * pose.scales[:, None, :]
        local[:, :3, 3], local[:, 3, 3] = pose.translations, 1.0
        for j, parent in enumerate(self.parents):
            if parent >= 0:
                local[j] = local[parent] @ local[j]
        return local

    def rest_axes(self) -> Floats:
        """Rotation of each joint at rest in the space of the character, (j, 3, 3)."""
        return orthonormal(self.transforms(self.rest)[:, :3, :3])

    def rest_positions(self) -> Floats:
        """Position of each joint at rest, (j, 3) [m]."""
        return self.transforms(self.rest)[:, :3, 3]

    def turned(self, turns: dict[str, Floats], pose: Pose | None = None) -> Pose:
        """`pose`, the rest pose by default, with joints turned from rest by rotation vectors in the axes of the space.

        Parameters
        ----------
        turns : dict of str to (3,) ndarray [rad]
            Rotation of a joint relative to its parent, by the joint's name. It replaces the rotation of `pose`.
        pose : Pose, optional
            Pose of the other joints.

        Raises
        ------
        InputError
            The skeleton has no joint of a name.
        """
        base = self.rest if pose is None else pose
        axes, rotations = self.rest_axes(), base.rotations.copy()
        for name, turn in turns.items():
            if name not in self.names:
                raise InputError(f"There is no joint {name!r}.", f"Known: {', '.join(self.names)}.")
            j = self.names.index(name)
            parent = axes[self.parents[j]] if self.parents[j] >= 0 else np.eye(3)
            turned = to_matrices(from_rotation_vectors(turn)) @ axes[j]
            rotations[j] = from_matrices(parent.T @ turned)
        return Pose(base.translations, rotations, base.scales)


def skeleton_at(names: tuple[str, ...], parents: Ints, positions: Floats) -> Skeleton:
    """Skeleton whose joints are at `positions (j, 3)` [m] at rest, their axes those of the space."""
    inner = parents >= 0
    offsets = positions - np.where(inner[:, None], positions[np.where(inner, parents, 0)], 0.0)
    rotations = np.tile([1.0, 0.0, 0.0, 0.0], (len(names), 1))
    return Skeleton(names, parents, Pose(offsets, rotations, np.ones((len(names), 3))))


def orthonormal(matrices: Floats) -> Floats:
    """Nearest rotations (..., 3, 3) of matrices (..., 3, 3), by their polar decomposition."""
    u, _, vt = np.linalg.svd(matrices)
    u = u.copy()
    u[..., :, 2] *= np.sign(np.linalg.det(u @ vt))[..., None]
    return np.asarray(u @ vt, np.float64)
