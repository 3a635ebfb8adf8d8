"""Timeline of a body: a lead-in from its rest pose, a part of a motion, once or in a loop.

In the lead-in of length L the body is blended from its first pose to the motion run up to its start: at the time
u L its own time is start - L (1 - u^2)/2, its weight u^2 (3 - 2 u). The body leaves its first pose at no speed and
meets the start at the motion's own speed, so that cloth on it feels no jerk. What lies before the start is
its mirror image in the start, 2 P(start) - P(2 start - t), rotations likewise: so it meets any clip, looped or not.
"""

from dataclasses import dataclass, replace

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.files.characters.clip import Motion, blended, translated
from clothsim.files.characters.joint_roles import joint_roles
from clothsim.files.characters.quaternions import from_matrices, product, to_matrices
from clothsim.files.characters.skeleton import Pose, Skeleton, orthonormal


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
            u = max(time, 0.0) / self.lead_in
            before = self.lead_in * (1 - u * u) / 2
            return blended(self.first, self._placed(_run_up(self, before)), u * u * (3 - 2 * u))
        return self._placed(_pose_at(self, time - self.lead_in))

    @property
    def duration(self) -> float:
        """Time at which the body comes to rest [s]; infinite for a loop."""
        return np.inf if self.loop else self.lead_in + self.end - self.start

    def _placed(self, pose: Pose) -> Pose:
        """A pose of the motion turned about `centre` and shifted."""
        roots = np.flatnonzero(self.skeleton.parents < 0)
        translations, rotations = pose.translations.copy(), pose.rotations.copy()
        rotations[roots] = product(self.turn, rotations[roots])
        turned = (translations[roots] - self.centre) @ to_matrices(self.turn).T
        translations[roots] = turned + self.centre + self.shift
        return Pose(translations, rotations, pose.scales)


def _pose_at(line: Timeline, since: float) -> Pose:
    """Pose of the motion `since` its start [s], at least 0; beyond the end of a loop it is in another round."""
    length, rounds = line.end - line.start, 0
    if line.loop and length > 0:
        rounds = int(since // length)
        since -= rounds * length
    pose = line.motion.pose(min(line.start + since, line.end))
    if not rounds:
        return pose
    j = travelling_joint(line.skeleton)
    ends = [line.motion.pose(t).translations[j] for t in (line.start, line.end)]
    return translated(pose, j, rounds * (ends[1] - ends[0]))


def _run_up(line: Timeline, before: float) -> Pose:
    """Pose of the motion `before` its start [s]."""
    return blended(_pose_at(line, before), _pose_at(line, 0.0), 2.0)


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
        Turn the motion about the vertical and shift it horizontally, so that its lead-in starts above the place of
        `first` and the motion looks the same way.
    up : (3,) ndarray
        The vertical.
    """
    still = np.array([1.0, 0.0, 0.0, 0.0])
    straight = Timeline(skeleton, motion, first, lead_in, *span, loop, still, np.zeros(3), np.zeros(3))
    if not from_rest:
        return straight
    j = travelling_joint(skeleton)
    wanted, found = (skeleton.transforms(pose)[j] for pose in (first, motion.pose(span[0])))
    rotation = orthonormal(wanted[:3, :3]) @ orthonormal(found[:3, :3]).T
    turned = replace(straight, turn=twist(from_matrices(rotation), up), centre=found[:3, 3])
    begins = skeleton.transforms(turned._placed(_run_up(turned, lead_in / 2)))[j, :3, 3]
    shift = wanted[:3, 3] - begins
    return replace(turned, shift=shift - (shift @ up) * up)


def twist(quaternion: Floats, axis: Floats) -> Floats:
    """Part of a rotation (w, x, y, z) that turns about a unit axis (3,)."""
    part = np.concatenate([quaternion[:1], (quaternion[1:] @ axis) * axis])
    length = float(np.linalg.norm(part))
    return part / length if length > 1e-9 else np.array([1.0, 0.0, 0.0, 0.0])


def travelling_joint(skeleton: Skeleton) -> int:
    """The joint that carries the body through space: the pelvis, or else the first root."""
    return joint_roles(skeleton.names, skeleton.parents.tolist()).get("pelvis", 0)
