"""A body that cloth collides with: a mesh and a prescribed motion."""

from dataclasses import dataclass

import numpy as np

from clothsim.arrays import Floats, Ints, as_points, as_triangles, as_vector


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


def rotation_matrix(rotation_vector: Floats) -> Floats:
    """The rotation by |r| radians about r, (3, 3) (Rodrigues)."""
    angle = float(np.linalg.norm(rotation_vector))
    if angle == 0:
        return np.eye(3)
    x, y, z = rotation_vector / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


@dataclass(frozen=True)
class Body:
    """A closed or open surface that is never simulated: `positions (n, 3)` at time 0 [m], `triangles (m, 3)`."""

    name: str
    positions: Floats
    triangles: Ints
    motion: RigidMotion

    def at(self, time: float) -> Floats:
        """The vertices at `time` [s], (n, 3) [m]."""
        return self.motion.apply(self.positions, time)


def make_body(name: str, positions: Floats, triangles: Ints, motion: RigidMotion | None = None) -> Body:
    """A body, checked; without a motion it stands still. InputError names the first bad vertex or triangle."""
    points = as_points(f"{name} positions", positions)
    faces = as_triangles(f"{name} triangles", triangles, len(points))
    return Body(name, points, faces, rigid_motion() if motion is None else motion)
