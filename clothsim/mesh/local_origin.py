"""Local origin of a world far from the origin: round-off is then that of its size, not of its position."""

from dataclasses import replace

import numpy as np

from clothsim.mesh.body import Body
from clothsim.mesh.motion import RigidMotion
from clothsim.mesh.world import World

FAR = 100.0
"""Distance from the origin, in sizes of the cloth, from which on a world gets a local origin."""


def with_local_origin(world: World) -> World:
    """Return the world relative to the centre of its cloths, with `origin` set; unchanged where that is near."""
    cloth = world.start()[: world.n_cloth]
    low, high = cloth.min(axis=0), cloth.max(axis=0)
    middle = 0.5 * (low + high)
    if np.linalg.norm(middle) <= FAR * np.linalg.norm(high - low):
        return world
    cloths = tuple(replace(each, positions=each.positions - middle) for each in world.cloths)
    bodies = tuple(_moved(body, middle) for body in world.bodies)
    rigid = tuple(body.relative_to(middle) for body in world.rigid)
    return replace(world, cloths=cloths, bodies=bodies, rigid=rigid, origin=world.origin + middle)


def _moved(body: Body, origin: np.ndarray) -> Body:
    motion = body.motion
    if isinstance(motion, RigidMotion):
        motion = replace(motion, centre=motion.centre - origin)
    return replace(body, positions=body.positions - origin, motion=motion)
