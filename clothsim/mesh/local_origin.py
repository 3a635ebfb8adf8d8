"""Local origin of a world far from the origin: round-off is then that of its size, not of its position."""

import math
from dataclasses import replace

import numpy as np

from clothsim.base.errors import InputError
from clothsim.mesh.body import Body
from clothsim.mesh.motion import RigidMotion
from clothsim.mesh.world import World

FAR = 100.0
"""Distance from the origin, in sizes of the cloth, from which on a world gets a local origin."""

COARSEST = 1e-6
"""Spacing of the coordinates in double precision, in sizes of the cloth, from which on a world is refused: neither its
meshes nor its frames could hold the shape."""


def with_local_origin(world: World) -> World:
    """Return the world relative to the centre of its cloths, with `origin` set; unchanged where that is near.

    InputError where it is so far that coordinates there do not resolve the cloth.
    """
    cloth = world.start()[: world.n_cloth]
    low, high = cloth.min(axis=0), cloth.max(axis=0)
    middle = 0.5 * (low + high)
    if math.hypot(*middle) <= FAR * math.hypot(*(high - low)):
        return world
    size, far = math.hypot(*(high - low)), float(np.abs(middle).max())
    spacing = float(np.spacing(far))
    if spacing > COARSEST * size:
        raise InputError(
            f"{world.cloths[0].name} is {far:.2g} m from the origin, where double precision tells "
            f"only points {spacing:.2g} m apart; the cloth is {size:.2g} m long.",
            "Move cloths and bodies near the origin (position).",
        )
    cloths = tuple(replace(each, positions=each.positions - middle) for each in world.cloths)
    bodies = tuple(_shift(body, middle) for body in world.bodies)
    rigid = tuple(body.relative_to(middle) for body in world.rigid)
    return replace(world, cloths=cloths, bodies=bodies, rigid=rigid, origin=world.origin + middle)


def _shift(body: Body, origin: np.ndarray) -> Body:
    motion = body.motion
    if isinstance(motion, RigidMotion):
        motion = replace(motion, centre=motion.centre - origin)
    return replace(body, positions=body.positions - origin, motion=motion)
