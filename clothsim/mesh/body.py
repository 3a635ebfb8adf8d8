"""Collision bodies: triangle meshes with a prescribed motion, rigid, posed, or between animated frames.

A motion maps the vertices of a body at time 0 to a time.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats, Ints, as_points, as_positive, as_triangles, as_vector
from clothsim.base.errors import InputError
from clothsim.keys.effect_tables import Motion as MotionKeys


@dataclass(frozen=True)
class RigidMotion:
    """Rigid motion x(t) = centre + R(angular_velocity t) (x(0) - centre) + velocity t.

    Parameters
    ----------
    velocity : (3,) float64
        [m/s].
    angular_velocity : (3,) float64
        Along the axis [rad/s].
    centre : (3,) float64
        Point on the axis [m].
    """

    velocity: Floats
    angular_velocity: Floats
    centre: Floats

    @property
    def still(self) -> bool:
        """True without motion."""
        return not (self.velocity.any() or self.angular_velocity.any())

    def apply(self, points: Floats, time: float) -> Floats:
        """Return `points (n, 3)` of time 0 at `time` [s]."""
        if self.still:
            return points
        turned = (points - self.centre) @ rotation_matrix(self.angular_velocity * time).T
        return turned + self.centre + self.velocity * time


@dataclass(frozen=True)
class FrameMotion:
    """Animated motion x(t) = x(0) + u(t): linear in time between frames, constant after the last one.

    Contact follows a body along straight paths from the start of a step to its end. A step no longer than a frame
    deviates from the animated path at most at one corner; a longer one skips whole frames.

    Parameters
    ----------
    displacements : (k, n, 3) float64
        Of each frame from the first [m], frame i at i / frames_per_second [s].
    frames_per_second : float
        Frame rate [1/s].
    """

    displacements: Floats
    frames_per_second: float

    @property
    def still(self) -> bool:
        """True without motion."""
        return not self.displacements.any()

    @property
    def duration(self) -> float:
        """Time of the last frame [s]."""
        return (len(self.displacements) - 1) / self.frames_per_second

    def apply(self, points: Floats, time: float) -> Floats:
        """Return `points (n, 3)` of time 0, one for each animated vertex, at `time` [s]."""
        if self.still:
            return points
        last = len(self.displacements) - 1
        position = min(max(time * self.frames_per_second, 0.0), float(last))
        before = min(int(position), last - 1)
        fraction = position - before
        return points + (1 - fraction) * self.displacements[before] + fraction * self.displacements[before + 1]


@dataclass(frozen=True)
class LaterMotion:
    """x(t) = motion(positions, t - since): a rigid motion that begins at `since` [s] from `positions (n, 3)` [m].

    A simulation that is stepped by hand sets it between two steps. It counts as moving even where `motion` stands
    still, as the points may have to be moved to `positions` first.
    """

    positions: Floats
    motion: RigidMotion
    since: float

    @property
    def still(self) -> bool:
        """False: the positions are prescribed in every step."""
        return False

    def apply(self, points: Floats, time: float) -> Floats:
        """The own `positions` moved to `time` [s]; `points`, those at time 0, are not used."""
        return self.motion.apply(self.positions, time - self.since)


@dataclass(frozen=True)
class PosedMotion:
    """Motion x(t) = x(0) + u(t) of a body that is posed at every time, such as a character on its skeleton.

    Parameters
    ----------
    displacement : callable
        u(t) of each vertex, (n, 3) [m], by the time [s].
    duration : float
        Time from which on it stands still [s].
    """

    displacement: Callable[[float], Floats]
    duration: float

    @property
    def still(self) -> bool:
        """True without motion."""
        return self.duration <= 0

    def apply(self, points: Floats, time: float) -> Floats:
        """Return `points (n, 3)` of time 0, one for each vertex, at `time` [s]."""
        return points if self.still else points + self.displacement(time)


@dataclass(frozen=True)
class FreeMotion:
    """Motion of a rigid body that forces move (`mesh.rigid_body`): none is prescribed."""

    @property
    def still(self) -> bool:
        """True: no position is prescribed."""
        return True

    def apply(self, points: Floats, time: float) -> Floats:
        """Return `points (n, 3)` of time 0: where they are later is part of the solution."""
        return points


Motion = RigidMotion | FrameMotion | PosedMotion | LaterMotion | FreeMotion


def rigid_motion(
    velocity: Floats | tuple[float, ...] = (0.0, 0.0, 0.0),
    rotate_degrees_per_second: Floats | tuple[float, ...] = (0.0, 0.0, 0.0),
    centre: Floats | tuple[float, ...] = (0.0, 0.0, 0.0),
) -> RigidMotion:
    """Make a rigid motion from the keys of a scene: velocity [m/s], rotation about `centre` [degrees/s]."""
    return RigidMotion(
        as_vector("motion.velocity", velocity),
        np.radians(as_vector("motion.rotate_degrees_per_second", rotate_degrees_per_second)),
        as_vector("motion.centre", centre),
    )


def motion_of(where: str, keys: Mapping[str, Any], origin: Floats) -> RigidMotion:
    """Make the motion of a scene's keys, relative to the world's `origin (3,)` [m]; InputError names an unknown key."""
    try:
        motion = rigid_motion(**keys)
    except TypeError as error:
        known = "velocity, rotate_degrees_per_second, centre"
        raise InputError(f"{where} has an unknown key: {error}.", f"Known: {known}.") from error
    return replace(motion, centre=motion.centre - origin)


def prescribed_motion(keys: MotionKeys | None, centre: Floats, origin: Floats) -> RigidMotion:
    """Make the motion of a scene's keys, relative to the world's `origin (3,)` [m]; without a centre about `centre`."""
    keys = keys or MotionKeys()
    about = centre if keys.centre is None else np.array(keys.centre, np.float64)
    velocity, degrees = np.array(keys.velocity, np.float64), np.array(keys.rotate_degrees_per_second, np.float64)
    return RigidMotion(velocity, np.radians(degrees), about - origin)


def frame_motion(frames: Floats, frames_per_second: float) -> FrameMotion:
    """Make the motion through `frames (k, n, 3)` [m], k >= 1; InputError for another shape or numbers not finite."""
    points = np.asarray(frames, np.float64)
    if points.ndim != 3 or points.shape[2] != 3 or not len(points):
        raise InputError(f"frames has shape {points.shape}, not (frames, vertices, 3).")
    if not np.isfinite(points).all():
        frame, vertex = np.argwhere(~np.isfinite(points))[0, :2]
        raise InputError(f"frames: vertex {vertex} of frame {frame} is not finite.")
    return FrameMotion(points - points[0], as_positive("frames_per_second", frames_per_second))


def rotation_matrix(rotation_vector: Floats) -> Floats:
    """Return the rotation by |r| radians about r, (3, 3) (Rodrigues)."""
    angle = float(np.linalg.norm(rotation_vector))
    if angle == 0:
        return np.eye(3)
    x, y, z = rotation_vector / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


@dataclass(frozen=True)
class Body:
    """Closed or open surface that is never simulated.

    Parameters
    ----------
    name : str
        Name in the scene.
    positions : (n, 3) float64
        Vertices at time 0 [m].
    triangles : (m, 3) int64
        Vertex indices.
    motion : Motion
        Prescribed motion.
    """

    name: str
    positions: Floats
    triangles: Ints
    motion: Motion

    def at(self, time: float) -> Floats:
        """Return the vertices at `time` [s], (n, 3) [m]."""
        return self.motion.apply(self.positions, time)


def make_body(name: str, positions: Floats, triangles: Ints, motion: Motion | None = None) -> Body:
    """Make a body from checked arrays; without a motion it stands still.

    Raises
    ------
    InputError
        Naming the first bad vertex or triangle.
    """
    points = as_points(f"{name} positions", positions)
    faces = as_triangles(f"{name} triangles", triangles, len(points))
    if isinstance(motion, FrameMotion) and motion.displacements.shape[1:] != points.shape:
        raise InputError(f"{name} has {len(points)} vertices, its frames have {motion.displacements.shape[1]}.")
    return Body(name, points, faces, rigid_motion() if motion is None else motion)
