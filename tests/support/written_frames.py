"""Trajectories of random frames: two cloths, a still body and a moving one."""

import numpy as np
from meshes import cloth, grid

from clothsim.files.runs.trajectory import TrajectoryWriter
from clothsim.mesh.body import make_body, rigid_motion
from clothsim.mesh.world import make_world, world_surfaces


def two_of_each():
    """Two cloths, a still and a moving body, all of different sizes."""
    sheets = [cloth(*grid(3, 2), name="skirt"), cloth(*grid(2, 2), name="top/left")]
    still = make_body("floor", *grid(1, 1))
    moving = make_body("kick", *grid(2, 1), motion=rigid_motion(velocity=(1.0, 0.0, 0.0)))
    return make_world(sheets, [still, moving])


WORLD = two_of_each()
TIMES = [0.0, 0.04, 1 / 3, 2.0]


def frame(i):
    """Positions and stretches of frame i: random bits in every place that may change, the floor where it is."""
    rng = np.random.default_rng(i)
    x = WORLD.start() + rng.standard_normal((WORLD.n_vertices, 3))
    x[WORLD.body_slices[0]] = WORLD.bodies[0].positions
    return x, rng.random((len(WORLD.triangles), 2))


def write(path, frames=range(4), **keywords):
    with TrajectoryWriter(path, world_surfaces(WORLD), **keywords) as writer:
        for i in frames:
            writer.append(TIMES[i], *frame(i))
