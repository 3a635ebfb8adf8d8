"""Skeleton: a hierarchy of joints with their transforms at rest, and forward kinematics."""

from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.files.characters.quaternions import from_matrices, from_rotation_vectors, to_matrices


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
