"""Rigid bodies of a scene's [[rigid]] tables, and the energies that come with them."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.keys.mesh_keys import RigidTable
from clothsim.mesh.rigid_body import Joint, RigidBody, rigid_body
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Energy
from clothsim.physics.energies.key_values import selected_vertices
from clothsim.physics.energies.rigid_bodies import Tied, rigid_ties, rigidity
from clothsim.physics.energies.seams import STIFFER
from clothsim.scene.assembly.meshes import mesh_shape
from clothsim.scene.assembly.placement import examined, name_of, placed
from clothsim.scene.scene import Scene


def rigid_body_of(keys: RigidTable, where: str, scene: Scene) -> tuple[RigidBody, tuple[str, ...]]:
    """The rigid body of a [[rigid]] table, and notes for the user. InputError for a mesh that is no solid."""
    shape = mesh_shape(keys, where, scene.directory)
    label = name_of(keys, where)
    notes = examined(label, shape, "body")
    body = rigid_body(
        label,
        placed(keys, shape.positions),
        shape.triangles,
        keys.density,
        np.array(keys.velocity, np.float64),
        np.radians(np.array(keys.spin_degrees_per_second, np.float64)),
        keys.stiffness,
        _joint(keys.joint, where),
    )
    return body, (*notes, f"{label}: rigid, {body.mass:.4g} kg.")


def rigid_energies(scene: Scene, world: World, energies: Mapping[str, Energy]) -> dict[str, Energy]:
    """The rigidity of a world's rigid bodies, and their ties.

    Raises
    ------
    InputError
        The scene has no inertia, a policy of pinches that does not know rigid bodies, or a tie without a stiffness.
    """
    if not world.rigid:
        return {}
    if "inertia" not in energies:
        raise InputError("Rigid bodies need effects.inertia.", "Write [effects.inertia], or make the body a [[body]].")
    if scene.contact_settings.pinch != "stop":
        raise InputError('contact.pinch = "carry" does not work with rigid bodies.', "Leave the key out.")
    tied = [each for number, keys in enumerate(scene.rigid_bodies) for each in _tied(scene, world, number, keys)]
    made: dict[str, Energy] = {"rigidity": rigidity(world)}
    return made | ({"rigid_ties": rigid_ties(world, tied)} if tied else {})


def _joint(keys: Any, where: str) -> Joint | None:
    """The joint of `JointKeys`."""
    if keys is None:
        return None
    direction = np.zeros(3) if keys.axis is None else np.array(keys.axis, np.float64)
    if keys.axis is not None and not direction.any():
        raise InputError(f"{where}.joint.axis is zero.", "Give a direction, or leave it out for a ball joint.")
    return Joint(np.array(keys.point, np.float64), direction)


def _tied(scene: Scene, world: World, number: int, keys: RigidTable) -> Sequence[Tied]:
    """The ties of one rigid body."""
    found = []
    several = len(scene.rigid_bodies) > 1
    tie: Any
    for k, tie in enumerate(keys.tie):
        where = f"rigid[{number}].tie[{k}]" if several else f"rigid.tie[{k}]"
        vertices = selected_vertices(f"{where}.select", world, tie.select)
        stiffness = STIFFER * _fabric_stiffness(where, world) if tie.stiffness is None else tie.stiffness
        found.append(Tied(number, vertices, stiffness))
    return found


def _fabric_stiffness(where: str, world: World) -> float:
    along: Floats = np.sqrt(world.per_triangle("stiffness_along_warp") * world.per_triangle("stiffness_along_weft"))
    if not along.max() > 0:
        raise InputError(f"{where} has no stiffness: the fabric has none.", "Give it a stiffness in N/m.")
    return float(along.max())
