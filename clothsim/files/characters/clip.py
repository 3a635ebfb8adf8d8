"""Motion clips: key frames of joint transforms, interpolated at any time, and their timeline in a scene.

A timeline is a lead-in from the rest pose and a part of a motion, once or in a loop. In the lead-in of length L the
body is blended from its first pose to the motion run up to its start: at the time u L its own time is
start - L (1 - u^2)/2, its weight u^2 (3 - 2 u). The body leaves its first pose at no speed and meets the start at the
motion's own speed, so that cloth on it feels no jerk. What lies before the start is its mirror image in the start,
2 P(start) - P(2 start - t), rotations likewise: so it meets any clip, looped or not.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, Protocol

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.files.characters.skeleton import (
    Pose,
    Skeleton,
    from_matrices,
    joint_roles,
    orthonormal,
    product,
    slerp,
    to_matrices,
)

Path = Literal["translations", "rotations", "scales"]
Interpolation = Literal["linear", "step", "cubic"]


@dataclass(frozen=True)
class Track:
    """Key frames of m joints.

    Attributes
    ----------
    path : str
        The part of their transforms: "translations", "rotations" or "scales".
    joints : (m,) ndarray
    times : (k,) ndarray [s]
        Increasing.
    values : (k, m, c) ndarray
        c is 4 for rotations (unit quaternions w, x, y, z), else 3.
    interpolation : str
        "linear" (rotations by slerp), "step", or "cubic" (Hermite, as in glTF).
    tangents : (2, k, m, c) ndarray [1/s]
        In and out of each key frame, for "cubic"; (2, 0, 0, 0) else.
    """

    path: Path
    joints: Ints
    times: Floats
    values: Floats
    interpolation: Interpolation
    tangents: Floats

    def at(self, time: float) -> Floats:
        """Values at a time, (m, c); those of the first or last key frame beyond them."""
        k = int(np.clip(np.searchsorted(self.times, time, side="right") - 1, 0, max(len(self.times) - 2, 0)))
        if len(self.times) == 1 or time <= self.times[0]:
            return self.values[0]
        if time >= self.times[-1]:
            return self.values[-1]
        step = self.times[k + 1] - self.times[k]
        t = float((time - self.times[k]) / step)
        start, end = self.values[k], self.values[k + 1]
        if self.interpolation == "step":
            return start
        if self.interpolation == "cubic":
            out, into = self.tangents[1, k], self.tangents[0, k + 1]
            mixed = (
                (2 * t**3 - 3 * t**2 + 1) * start
                + step * (t**3 - 2 * t**2 + t) * out
                + (3 * t**2 - 2 * t**3) * end
                + step * (t**3 - t**2) * into
            )
            rotates = self.path == "rotations"
            return np.asarray(mixed / np.linalg.norm(mixed, axis=-1, keepdims=True) if rotates else mixed, np.float64)
        return slerp(start, end, t) if self.path == "rotations" else (1 - t) * start + t * end


class SkeletonMotion(Protocol):
    """Pose of a skeleton at any time from 0 to `duration` [s]."""

    @property
    def duration(self) -> float:
        """Time of the last key frame [s]."""

    def pose(self, time: float) -> Pose:
        """Pose at `time` [s]."""


@dataclass(frozen=True)
class Clip:
    """Motion of a skeleton.

    Attributes
    ----------
    name : str
    skeleton : Skeleton
    base : Pose
        Transforms of what no track moves.
    tracks : tuple of Track
    """

    name: str
    skeleton: Skeleton
    base: Pose
    tracks: tuple[Track, ...]

    @cached_property
    def duration(self) -> float:
        """Time of the last key frame [s]."""
        return max((float(track.times[-1]) for track in self.tracks), default=0.0)

    def pose(self, time: float) -> Pose:
        """Pose at `time` [s]."""
        parts = {path: getattr(self.base, path).copy() for path in ("translations", "rotations", "scales")}
        for track in self.tracks:
            parts[track.path][track.joints] = track.at(time)
        return Pose(**parts)


def uniform_clip(name: str, skeleton: Skeleton, rate: float, rotations: Floats, root: Floats) -> Clip:
    """Clip with the rotations of all joints, and the translation of the first, in frames of a constant rate.

    Parameters
    ----------
    name : str
    skeleton : Skeleton
    rate : float
        Frames per second [1/s].
    rotations : (k, j, 4) ndarray
        Relative to the parents.
    root : (k, 3) ndarray [m]
        Translation of joint 0.
    """
    times, none = np.arange(len(rotations)) / rate, np.zeros((2, 0, 0, 0))
    turns = Track("rotations", np.arange(len(skeleton.names)), times, rotations, "linear", none)
    moves = Track("translations", np.zeros(1, np.int64), times, root[:, None, :], "linear", none)
    return Clip(name, skeleton, skeleton.rest, (turns, moves))


def blended(start: Pose, end: Pose, fraction: float) -> Pose:
    """Pose between two: rotations by slerp, the rest linear; fraction from 0 to 1."""
    return Pose(
        (1 - fraction) * start.translations + fraction * end.translations,
        slerp(start.rotations, end.rotations, fraction),
        (1 - fraction) * start.scales + fraction * end.scales,
    )


def translated(pose: Pose, joint: int, displacement: Floats) -> Pose:
    """`pose` with a joint displaced by (3,) [m] in the axes of its parent."""
    moved = pose.translations.copy()
    moved[joint] += displacement
    return replace(pose, translations=moved)


@dataclass(frozen=True)
class Timeline:
    """Pose of a skeleton by the time of a scene.

    Attributes
    ----------
    skeleton : Skeleton
    motion : SkeletonMotion
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
    motion: SkeletonMotion
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
    motion: SkeletonMotion,
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
    motion : SkeletonMotion
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
