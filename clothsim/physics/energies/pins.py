"""Prescribed vertices, fixed or on a rigid motion: the effect `pins`."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.mesh.clamp import clamped
from clothsim.mesh.motion import LaterMotion, RigidMotion, motion_of
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Off
from clothsim.physics.energies.constraint import Constraint, Prescribed
from clothsim.physics.energies.example import Example
from clothsim.physics.energies.selection import check_tables, selected_vertices

GROUP = ("select", "clamp", "motion")


@dataclass(frozen=True)
class PinGroup:
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
class Pins(Constraint):
    """Prescribed positions of the groups, with the ghost vertices that fix the direction at clamped edges."""

    groups: tuple[PinGroup, ...]

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


def pins(
    world: World,
    *,
    select: str | Sequence[int] | Mapping[str, Sequence[Sequence[float]]] = (),
    clamp: bool = False,
    motion: Mapping[str, Sequence[float]] | None = None,
    group: Sequence[Mapping[str, object]] = (),
) -> tuple[World, Constraint] | Off:
    """Pinned vertices: one selection, and groups with a selection and motion each.

    Parameters
    ----------
    select : str, sequence of int or {"box": [lo, hi]}
        Vertices (`energies.selection`).
    clamp : bool
        True to fix the rest direction at the edge too.
    motion : table, optional
        Rigid motion (`mesh.motion`).
    group : sequence of tables
        Further groups, each with `select` and optionally `clamp` and `motion`.

    Returns
    -------
    The world, which clamps enlarge by ghost vertices, and the constraint; or Off where no vertex is selected.

    Raises
    ------
    InputError
        For unknown selections and motions, or a vertex in two groups.
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
