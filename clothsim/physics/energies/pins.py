"""Prescribed vertices, fixed or on a rigid motion: the effect `pins`."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.keys.typed_effects import Pins
from clothsim.mesh.body import LaterMotion, RigidMotion, prescribed_motion
from clothsim.mesh.clamp import clamped
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Constraint, Off, Prescribed
from clothsim.physics.energies.example import Example
from clothsim.physics.energies.key_values import selected_vertices


@dataclass(frozen=True)
class PinnedGroup:
    """Vertices with one prescribed motion.

    Parameters
    ----------
    vertices : (k,) int array
        Rows of x.
    start : (k, 3) array
        Positions at time 0 [m].
    motion : RigidMotion
        Prescribed motion.
    name : str
        The scene's name, "pins" or "pins.group[1]".
    """

    vertices: Ints
    start: Floats
    motion: RigidMotion | LaterMotion
    name: str


@dataclass(frozen=True)
class PinsConstraint(Constraint):
    """Prescribed positions of the groups, with the ghost vertices that fix the direction at clamped edges."""

    groups: tuple[PinnedGroup, ...]

    @property
    def still(self) -> bool:
        """True where no group ever moves."""
        return all(group.motion.still for group in self.groups)

    def at(self, time: float) -> Prescribed:
        """The pinned vertices and their positions at `time` [s]."""
        return Prescribed(
            np.concatenate([group.vertices for group in self.groups]),
            np.concatenate([group.motion.apply(group.start, time) for group in self.groups]),
        )

    def holder(self, row: int) -> str:
        """The name of the group that prescribes a row of x, empty if none does."""
        return next((group.name for group in self.groups if row in group.vertices), "")

    def angular_velocities(self) -> Mapping[str, Floats]:
        """Of each group, also one that was set by hand."""
        motions = {group.name: group.motion for group in self.groups}
        return {
            name: (each.motion if isinstance(each, LaterMotion) else each).angular_velocity
            for name, each in motions.items()
        }


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
