"""How a body moves: rigidly, or through frames that somebody animated. Both carry its vertices of time 0 to a time."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from clothsim.arrays import Floats, as_positive, as_vector
from clothsim.errors import InputError


@dataclass(frozen=True)
class RigidMotion:
    """x(t) = centre + R(angular_velocity t) (x(0) - centre) + velocity t.

    velocity: (3,) [m/s]; angular_velocity: (3,) [rad/s], along the axis; centre: (3,) [m].
    """

    velocity: Floats
    angular_velocity: Floats
    centre: Floats

    @property
    def still(self) -> bool:
        """True where nothing ever moves."""
        return not (self.velocity.any() or self.angular_velocity.any())

    def apply(self, points: Floats, time: float) -> Floats:
        """`points (n, 3)` of time 0 carried to `time` [s]."""
        if self.still:
            return points
        turned = (points - self.centre) @ rotation_matrix(self.angular_velocity * time).T
        return turned + self.centre + self.velocity * time


@dataclass(frozen=True)
class FrameMotion:
    """x(t) = x(0) + the displacement at t: linear in time from frame to frame, held at the last one after the end.

    displacements: (k, n, 3) of each frame from the first [m], frame i at i / frames_per_second [s].

    Contact follows a body on straight ways from where it is at the start of a step to where it is at its end. A step
    no longer than a frame leaves that way at most at one corner; a longer one cuts whole frames off it.
    """

    displacements: Floats
    frames_per_second: float

    @property
    def still(self) -> bool:
        """True where nothing ever moves."""
        return not self.displacements.any()

    @property
    def duration(self) -> float:
        """When the last frame is reached [s]."""
        return (len(self.displacements) - 1) / self.frames_per_second

    def apply(self, points: Floats, time: float) -> Floats:
        """`points (n, 3)` of time 0, one for each that is animated, carried to `time` [s]."""
        if self.still:
            return points
        last = len(self.displacements) - 1
        place = min(max(time * self.frames_per_second, 0.0), float(last))
        before = min(int(place), last - 1)
        share = place - before
        return points + (1 - share) * self.displacements[before] + share * self.displacements[before + 1]


@dataclass(frozen=True)
class LaterMotion:
    """x(t) = motion(places, t - since): a rigid motion that begins at `since` [s] from `places (n, 3)` [m].

    A simulation that is stepped by hand sets it between two steps. It counts as moving even where `motion` stands
    still, as the points may have to be moved to `places` first.
    """

    places: Floats
    motion: RigidMotion
    since: float

    @property
    def still(self) -> bool:
        """False: the positions are prescribed in every step."""
        return False

    def apply(self, points: Floats, time: float) -> Floats:
        """`places` carried to `time` [s]; `points`, the positions at time 0, do not matter any more."""
        return self.motion.apply(self.places, time - self.since)


Motion = RigidMotion | FrameMotion | LaterMotion


def rigid_motion(
    velocity: Floats | tuple[float, ...] = (0.0, 0.0, 0.0),
    rotate_degrees_per_second: Floats | tuple[float, ...] = (0.0, 0.0, 0.0),
    centre: Floats | tuple[float, ...] = (0.0, 0.0, 0.0),
) -> RigidMotion:
    """A rigid motion from a scene's keys: velocity [m/s], rotation about the axis through `centre` [degrees/s]."""
    return RigidMotion(
        as_vector("motion.velocity", velocity),
        np.radians(as_vector("motion.rotate_degrees_per_second", rotate_degrees_per_second)),
        as_vector("motion.centre", centre),
    )


def motion_of(where: str, keys: Mapping[str, Any], origin: Floats) -> RigidMotion:
    """The motion of a scene's keys, relative to the world's `origin (3,)` [m]."""
    try:
        motion = rigid_motion(**keys)
    except TypeError as error:
        known = "velocity, rotate_degrees_per_second, centre"
        raise InputError(f"{where} has an unknown key: {error}.", f"Known: {known}.") from error
    return replace(motion, centre=motion.centre - origin)


def frame_motion(frames: Floats, frames_per_second: float) -> FrameMotion:
    """The motion through `frames (k, n, 3)` [m], k >= 1. InputError for another shape and numbers not finite."""
    places = np.asarray(frames, np.float64)
    if places.ndim != 3 or places.shape[2] != 3 or not len(places):
        raise InputError(f"frames has shape {places.shape}, not (frames, vertices, 3).")
    if not np.isfinite(places).all():
        frame, vertex = np.argwhere(~np.isfinite(places))[0, :2]
        raise InputError(f"frames: vertex {vertex} of frame {frame} is not finite.")
    return FrameMotion(places - places[0], as_positive("frames_per_second", frames_per_second))


def rotation_matrix(rotation_vector: Floats) -> Floats:
    """The rotation by |r| radians about r, (3, 3) (Rodrigues)."""
    angle = float(np.linalg.norm(rotation_vector))
    if angle == 0:
        return np.eye(3)
    x, y, z = rotation_vector / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
