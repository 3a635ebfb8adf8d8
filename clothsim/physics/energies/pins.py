"""Prescribed vertices, fixed or on a rigid motion: the effect `pins`."""

from collections.abc import Sequence

import numpy as np

from clothsim.base.arrays import Ints
from clothsim.base.errors import InputError
from clothsim.keys.typed_effects import Pins
from clothsim.mesh.body import prescribed_motion
from clothsim.mesh.clamp import clamped
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Constraint, Off, PinnedGroup, PinsConstraint
from clothsim.physics.energies.example import Example
from clothsim.physics.energies.key_values import selected_vertices


def pins(world: World, keys: Pins) -> tuple[World, Constraint] | Off:
    """The world, which clamps enlarge by ghost vertices, and the constraint; off where no vertex is selected.

    Raises
    ------
    InputError
        For unknown selections, or a vertex in two groups.
    """
    groups = [("pins", keys), *((f"pins.group[{k}]", group) for k, group in enumerate(keys.group))]
    selected = [(selected_vertices("effects.pins.select", world, each.select), each, name) for name, each in groups]
    chosen = [(vertices, each, name) for vertices, each, name in selected if len(vertices)]
    if not chosen:
        return Off("no vertex is selected")
    _refuse_shared([vertices for vertices, _, _ in chosen])
    none = np.zeros(0, np.int64)
    world, ghosts = clamped(world, [vertices if each.clamp else none for vertices, each, _ in chosen])
    start = world.start()
    pinned = []
    for (vertices, each, name), extra in zip(chosen, ghosts, strict=True):
        rows = np.concatenate([vertices, extra])
        motion = prescribed_motion(each.motion, start[vertices].mean(axis=0) + world.origin, world.origin)
        pinned.append(PinnedGroup(rows, start[rows], motion, name))
    return world, PinsConstraint(tuple(pinned))


def _refuse_shared(groups: Sequence[Ints]) -> None:
    vertices, counts = np.unique(np.concatenate(groups), return_counts=True)
    if (counts > 1).any():
        raise InputError(
            f"effects.pins: vertex {vertices[counts > 1][0]} is in two groups.", "Give each vertex one motion."
        )


EXAMPLE = Example(
    keys={"select": "corners", "motion": {"velocity": (1.0, 2.0, 3.0), "rotate_degrees_per_second": (0, 90, 0)}},
    in_scene={"select": "corners"},
    zero={"select": []},
)
