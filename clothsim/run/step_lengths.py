"""Bounds on prescribed motion in one time step: rotation of bodies and pins, and displacement."""

from collections.abc import Collection

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.mesh.motion import LaterMotion, RigidMotion
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Constraint
from clothsim.scene.assembly.scene_world import Built

LARGEST_TURN = 45.0
"""Largest rotation in a step [degrees]: a straight path then leaves the arc by 8 % of the radius."""

LARGEST_FLIGHT = 100.0
"""Largest displacement in a step, in sizes of the scene: every pair of triangles is then a candidate for contact."""


def turns(built: Built) -> dict[str, float]:
    """Speed of rotation of each rigid body that contact follows, and of each group of pins [degrees/s].

    Animated bodies move on straight paths.
    """
    bodies = built.world.bodies if "body_contact" in built.energies else ()
    motions = {body.name: body.motion for body in bodies}
    motions = {name: each.motion if isinstance(each, LaterMotion) else each for name, each in motions.items()}
    rigid = {name: each.angular_velocity for name, each in motions.items() if isinstance(each, RigidMotion)}
    pinned = {
        name: speed
        for constraint in built.constraints.values()
        for name, speed in constraint.angular_velocities().items()
    }
    return {name: float(np.degrees(np.linalg.norm(speed))) for name, speed in {**rigid, **pinned}.items()}


def refuse_leaps(built: Built, dt: float) -> None:
    """InputError for a body or a group of pins that turns so far in a step that its straight path is far from its arc.

    At a full turn a step it would not move at all.
    """
    for name, speed in turns(built).items():
        turn = speed * dt
        if not turn <= LARGEST_TURN:
            raise InputError(
                f"{name} turns {turn:.4g} degrees in a step, and contact follows it on straight paths.",
                f"Take solver.dt below {dt * LARGEST_TURN / turn:.2g} s.",
            )


def refuse_flights(world: World, constraints: Collection[Constraint], dt: float, contact: bool) -> None:
    """InputError for what moves by many sizes of the scene in a step of `dt` [s].

    Pins drag the cloth along a straight path. With contact, bodies and cloth sweep over everything on theirs.
    """
    start = world.start()
    size = float(np.linalg.norm(np.ptp(start, axis=0)))
    with np.errstate(over="ignore", invalid="ignore"):
        moved = [_farthest(start, constraint, dt) for constraint in constraints]
        if contact:
            bodies = zip(world.bodies, world.body_slices, strict=True)
            moved += [(body.name, _longest(body.at(dt) - start[rows])) for body, rows in bodies]
            moved += [(cloth.name, dt * _longest(np.atleast_2d(cloth.velocity))) for cloth in world.cloths]
    for name, distance in moved:
        if not distance <= LARGEST_FLIGHT * size:
            sizes, pairs = distance / size, len(world.triangles) * (len(world.triangles) + len(world.body_triangles))
            raise InputError(
                f"{name} moves {distance:.2g} m in a step of {dt:g} s, {sizes:.2g} times the size of the scene"
                + (f": all {pairs:,} pairs of triangles are candidates for contact." if contact else "."),
                f"Take solver.dt below {dt * LARGEST_FLIGHT * size / distance:.2g} s, or a smaller velocity; "
                "--force lifts this bound.",
            )


def _farthest(start: Floats, constraint: Constraint, dt: float) -> tuple[str, float]:
    """Name of the group with the largest prescribed displacement in `dt` [s], and that [m]."""
    target = constraint.at(dt)
    distances = np.linalg.norm(target.positions - start[target.vertices], axis=1)
    farthest = int(np.argmax(distances))
    return constraint.holder(int(target.vertices[farthest])), float(distances[farthest])


def _longest(vectors: Floats) -> float:
    return float(np.linalg.norm(vectors, axis=1).max())
