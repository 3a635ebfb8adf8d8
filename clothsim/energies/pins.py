"""The effect `pins`: vertices that are held, or carried along a scripted rigid motion."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.energies.base import Off
from clothsim.energies.constraint import Constraint, Prescribed
from clothsim.energies.example import Example
from clothsim.energies.selection import check_tables, selected_vertices
from clothsim.errors import InputError
from clothsim.mesh.clamp import clamped
from clothsim.mesh.motion import LaterMotion, RigidMotion, motion_of
from clothsim.mesh.world import World

GROUP = ("select", "clamp", "motion")


@dataclass(frozen=True)
class PinGroup:
    """Vertices that move together: rows of x `vertices (k,)`, where they start `start (k, 3)` [m], and their motion.

    name: what the scene calls it, "pins" or "pins.group[1]".
    """

    vertices: Ints
    start: Floats
    motion: RigidMotion | LaterMotion
    name: str


@dataclass(frozen=True)
class Pins(Constraint):
    """Prescribes the positions of its groups, and of the ghosts that hold the direction at a clamped edge."""

    groups: tuple[PinGroup, ...]

    @property
    def still(self) -> bool:
        """True where no group ever moves."""
        return all(group.motion.still for group in self.groups)

    def at(self, time: float) -> Prescribed:
        """The pinned vertices and where they are at `time` [s]."""
        return Prescribed(
            np.concatenate([group.vertices for group in self.groups]),
            np.concatenate([group.motion.apply(group.start, time) for group in self.groups]),
        )

    def holder(self, row: int) -> str:
        """The name of the group that holds a row of x, empty where none does."""
        return next((group.name for group in self.groups if row in group.vertices), "")


def pins(
    world: World,
    *,
    select: str | Sequence[int] | Mapping[str, Sequence[Sequence[float]]] = (),
    clamp: bool = False,
    motion: Mapping[str, Sequence[float]] | None = None,
    group: Sequence[Mapping[str, object]] = (),
) -> tuple[World, Constraint] | Off:
    """Pins from a scene's keys: one selection, or several groups each with select, clamp and its own motion.

    Returns the world, which clamps enlarge by ghosts, and the constraint; Off where nothing is selected.
    """
    check_tables("effects.pins.group", group, GROUP, ("select",))
    specs: list[Mapping[str, object]] = [{"select": select, "clamp": clamp, "motion": motion}, *group]
    for spec in specs:
        if not isinstance(spec.get("clamp", False), bool):
            raise InputError(f"effects.pins.clamp must be true or false, not {spec['clamp']!r}.")
    names = ["pins", *(f"pins.group[{k}]" for k in range(len(group)))]
    chosen = [
        (selected_vertices("effects.pins.select", world, spec.get("select", ())), spec, name)
        for spec, name in zip(specs, names, strict=True)
    ]
    chosen = [(vertices, spec, name) for vertices, spec, name in chosen if len(vertices)]
    if not chosen:
        return Off("no vertex is selected")
    _refuse_shared([vertices for vertices, _, _ in chosen])
    none = np.zeros(0, np.int64)
    world, ghosts = clamped(world, [vertices if spec.get("clamp") else none for vertices, spec, _ in chosen])
    start = world.start()
    groups = []
    for (vertices, spec, name), extra in zip(chosen, ghosts, strict=True):
        rows = np.concatenate([vertices, extra])
        given = {} if spec.get("motion") is None else spec["motion"]
        if not isinstance(given, Mapping):
            raise InputError(f"effects.pins.motion must be a table of keys, not {given!r}.")
        keys = dict(given)
        keys.setdefault("centre", start[vertices].mean(axis=0) + world.origin)
        groups.append(PinGroup(rows, start[rows], motion_of("effects.pins.motion", keys, world.origin), name))
    return world, Pins(tuple(groups))


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
