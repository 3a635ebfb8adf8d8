"""Timeline of a body: a lead-in from its rest pose, a part of a motion, once or in a loop."""

from dataclasses import dataclass

import numpy as np

from clothsim.arrays import Floats
from clothsim.character.clip import Motion, blended
from clothsim.character.joint_roles import joint_roles
from clothsim.character.quaternions import from_matrices, product, to_matrices
from clothsim.character.skeleton import Pose, Skeleton, orthonormal


@dataclass(frozen=True)
class Timeline:
    """Pose of a skeleton by the time of a scene.

    Attributes
    ----------
    skeleton : Skeleton
    motion : Motion
    first : Pose
        Pose at time 0.
    lead_in : float
        Time from `first` to the motion's pose at `start` [s].
    start, end : float
        Part of the motion [s].
    loop : bool
        Repeat it; the body goes on from where the last round ended.
    turn : (4,) ndarray
        Quaternion that turns the motion about `centre`.
    centre, shift : (3,) ndarray [m]
    """

    skeleton: Skeleton
    motion: Motion
    first: Pose
    lead_in: float
    start: float
    end: float
    loop: bool
    turn: Floats
    centre: Floats
    shift: Floats

    def pose(self, time: float) -> Pose:
        """Pose at `time` [s]: constant before 0 and, without a loop, after the end."""
        if time < self.lead_in:
            fraction = max(time, 0.0) / self.lead_in
            return blended(self.first, self._moved(self.start), fraction * fraction * (3 - 2 * fraction))
        return self._moved(self.start + time - self.lead_in)

    @property
    def duration(self) -> float:
        """Time at which the body comes to rest [s]; infinite for a loop."""
        return np.inf if self.loop else self.lead_in + self.end - self.start

    def _moved(self, time: float) -> Pose:
        """Pose of the motion, turned and shifted; `time` beyond the end in a loop is a later round."""
        length = self.end - self.start
        rounds = 0
        if self.loop and length > 0:
            rounds = int((time - self.start) // length)
            time -= rounds * length
        pose = self.motion.pose(min(time, self.end))
        roots = np.flatnonzero(self.skeleton.parents < 0)
        translations, rotations = pose.translations.copy(), pose.rotations.copy()
        if rounds:
            j = travelling_joint(self.skeleton)
            ends = [self.motion.pose(t).translations[j] for t in (self.start, self.end)]
            translations[j] += rounds * (ends[1] - ends[0])
        rotations[roots] = product(self.turn, rotations[roots])
        turned = (translations[roots] - self.centre) @ to_matrices(self.turn).T
        translations[roots] = turned + self.centre + self.shift
        return Pose(translations, rotations, pose.scales)


def timeline(
    skeleton: Skeleton,
    motion: Motion,
    first: Pose,
    lead_in: float,
    span: tuple[float, float],
    loop: bool,
    from_rest: bool,
    up: Floats,
) -> Timeline:
    """Timeline of a motion.

    Parameters
    ----------
    skeleton : Skeleton
    motion : Motion
    first : Pose
        Pose at time 0.
    lead_in : float
        [s].
    span : (float, float)
        Start and end of the part of the motion [s].
    loop : bool
    from_rest : bool
        Turn the motion about the vertical and shift it horizontally, so that it starts above the place of `first` and
        looks the same way.
    up : (3,) ndarray
        The vertical.
    """
    still = np.array([1.0, 0.0, 0.0, 0.0])
    if not from_rest:
        return Timeline(skeleton, motion, first, lead_in, *span, loop, still, np.zeros(3), np.zeros(3))
    j = travelling_joint(skeleton)
    wanted, found = (skeleton.transforms(pose)[j] for pose in (first, motion.pose(span[0])))
    rotation = orthonormal(wanted[:3, :3]) @ orthonormal(found[:3, :3]).T
    turn = twist(from_matrices(rotation), up)
    shift = wanted[:3, 3] - found[:3, 3]
    return Timeline(skeleton, motion, first, lead_in, *span, loop, turn, found[:3, 3], shift - (shift @ up) * up)


def twist(quaternion: Floats, axis: Floats) -> Floats:
    """Part of a rotation (w, x, y, z) that turns about a unit axis (3,)."""
    part = np.concatenate([quaternion[:1], (quaternion[1:] @ axis) * axis])
    length = float(np.linalg.norm(part))
    return part / length if length > 1e-9 else np.array([1.0, 0.0, 0.0, 0.0])


def travelling_joint(skeleton: Skeleton) -> int:
    """The joint that carries the body through space: the pelvis, or else the first root."""
    return joint_roles(skeleton.names, skeleton.parents.tolist()).get("pelvis", 0)
