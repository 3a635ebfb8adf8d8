"""Skeleton: a hierarchy of joints with their transforms at rest, forward kinematics, and the roles of joints.

Roles are known by the names of Mixamo, CMU, SMPL, Blender, Unreal and the mannequin.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError

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


# Unit quaternions (w, x, y, z) of rotations: conversions and spherical interpolation.
#
# Conversions are SciPy's; its products and interpolations take two to eight times as long as the few lines here.


NEARLY_ALIKE = 1e-8
"""Angle [rad] below which two rotations are interpolated linearly, where the sine of the slerp would divide by zero."""


def from_rotation_vectors(vectors: Floats) -> Floats:
    """Quaternions (..., 4) of rotation vectors (..., 3) [rad]."""
    return _scalar_first(Rotation.from_rotvec(np.reshape(vectors, (-1, 3))), np.shape(vectors)[:-1])


def to_rotation_vectors(quaternions: Floats) -> Floats:
    """Rotation vectors (..., 3) [rad] of at most pi, of quaternions (..., 4)."""
    return np.reshape(_rotations(quaternions).as_rotvec(), (*quaternions.shape[:-1], 3))


def to_matrices(quaternions: Floats) -> Floats:
    """Rotation matrices (..., 3, 3) of unit quaternions (..., 4)."""
    return np.reshape(_rotations(quaternions).as_matrix(), (*quaternions.shape[:-1], 3, 3))


def from_matrices(matrices: Floats) -> Floats:
    """Unit quaternions (..., 4) of rotation matrices (..., 3, 3)."""
    return _scalar_first(Rotation.from_matrix(np.reshape(matrices, (-1, 3, 3))), np.shape(matrices)[:-2])


def _rotations(quaternions: Floats) -> Rotation:
    """SciPy's rotations, whose quaternions end with w."""
    return Rotation.from_quat(np.reshape(quaternions, (-1, 4))[:, [1, 2, 3, 0]])


def _scalar_first(rotations: Rotation, shape: tuple[int, ...]) -> Floats:
    return np.reshape(rotations.as_quat()[:, [3, 0, 1, 2]], (*shape, 4))


def product(first: Floats, second: Floats) -> Floats:
    """Hamilton products (..., 4): the rotation `second`, then `first`."""
    w, v = first[..., :1], first[..., 1:]
    u, x = second[..., :1], second[..., 1:]
    real = w * u - np.sum(v * x, axis=-1, keepdims=True)
    return np.concatenate([real, w * x + u * v + np.cross(v, x)], axis=-1)


def slerp(start: Floats, end: Floats, fraction: float) -> Floats:
    """Spherical linear interpolation along the shorter arc (Shoemake 1985).

    Parameters
    ----------
    start, end : (..., 4) ndarray
        Unit quaternions.
    fraction : float
        From 0 to 1.

    Returns
    -------
    (..., 4) ndarray
        Unit quaternions.
    """
    cosine = np.sum(start * end, axis=-1, keepdims=True)
    end = np.where(cosine < 0, -end, end)
    angle = 2 * np.arctan2(
        np.linalg.norm(end - start, axis=-1, keepdims=True), np.linalg.norm(end + start, axis=-1, keepdims=True)
    )
    near = angle < NEARLY_ALIKE
    sine = np.where(near, 1.0, np.sin(angle))
    weights = [np.where(near, part, np.sin(part * angle) / sine) for part in (1 - fraction, fraction)]
    mixed = weights[0] * start + weights[1] * end
    return np.asarray(mixed / np.linalg.norm(mixed, axis=-1, keepdims=True), np.float64)
