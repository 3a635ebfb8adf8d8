"""Collision body: a triangle mesh with a prescribed motion."""

from dataclasses import dataclass

from clothsim.base.arrays import Floats, Ints, as_points, as_triangles
from clothsim.base.errors import InputError
from clothsim.mesh.motion import FrameMotion, Motion, rigid_motion


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
