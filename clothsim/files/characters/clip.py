"""Motion clip: key frames of joint transforms, interpolated at any time."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, Protocol

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.files.characters.quaternions import slerp
from clothsim.files.characters.skeleton import Pose, Skeleton

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


class Motion(Protocol):
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
