"""The effect `springs`: vertices tied to places, which may move: springs, tethers that can go slack, soft pins.

E = k/2 (|x - c| - L)^2 for each vertex (`links`), k in N/m a vertex. Of length 0, a spring is a soft pin: it pulls its
vertex to c with k |x - c|, where a pin would hold it exactly. A tether (slack = true) pulls where it is longer than L
and is not there else, bit for bit.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from clothsim.arrays import Floats, Ints, as_points, as_positive, as_vector
from clothsim.energies.base import Energy, Off
from clothsim.energies.example import Example, Idle
from clothsim.energies.links import Links
from clothsim.energies.protocols import Anchored, Driven
from clothsim.energies.selection import as_flag, check_tables, selected_vertices
from clothsim.energies.step import Step
from clothsim.energies.varying_values import Schedule, schedule
from clothsim.errors import InputError
from clothsim.mesh.motion import RigidMotion, motion_of
from clothsim.mesh.world import World

KEYS = ("select", "stiffness", "to", "offset", "rest_length", "slack", "motion", "path")


@dataclass(frozen=True)
class Places:
    """Where the springs of one table end: start (k, 3) [m] at time 0, carried by a rigid motion, and then shifted by
    what is between the key frames shifts (f, 3) [m] at times (f,) [s]; stiffness [N/m].
    """

    start: Floats
    motion: RigidMotion
    times: Floats
    shifts: Floats
    stiffness: Schedule

    @property
    def still(self) -> bool:
        """True where nothing changes."""
        return self.motion.still and not self.shifts.any() and self.stiffness.is_constant

    def at(self, time: float) -> Floats:
        """The places at `time` [s], (k, 3) [m]."""
        shift = [np.interp(time, self.times, self.shifts[:, axis]) for axis in range(3)]
        return self.motion.apply(self.start, time) + np.array(shift)


@dataclass(frozen=True)
class Springs(Links, Anchored, Driven):
    """ends: where the springs of each table end."""

    ends: tuple[Places, ...]

    @property
    def drives(self) -> bool:
        """True where a place moves or a stiffness changes."""
        return not all(places.still for places in self.ends)

    @property
    def anchored_rows(self) -> Ints:
        """The vertices that are tied."""
        return self.rows[:, 0]

    def begin(self, step: Step) -> Self:
        """Bound to the places and stiffnesses at the end of the step."""
        now = step.time + step.dt
        levels = [np.full(len(places.start), places.stiffness.at(now)) for places in self.ends]
        return replace(
            self,
            places=np.concatenate([places.at(now) for places in self.ends]),
            stiffnesses=np.concatenate(levels),
        )


def springs(world: World, *, spring: Sequence[Mapping[str, Any]] = ()) -> Energy | Off:
    """Springs, each a table: `select` as pins have it; stiffness [N/m] of each vertex's, a number or key frames; `to`,
    one place [m] for all, or `offset`, from where each vertex starts to its own (default: a soft pin where it starts);
    rest_length [m] (default: as at the start); slack: true for a tether; `motion` of the places, with the keys of pins;
    path, key frames [[time, dx, dy, dz], ...] of a shift besides.
    """
    check_tables("effects.springs.spring", spring, KEYS, ("select", "stiffness"))
    tables = [(f"effects.springs.spring[{k}]", keys) for k, keys in enumerate(spring)]
    stiffnesses = [schedule(f"{name}.stiffness", keys["stiffness"], 0.0) for name, keys in tables]
    kept = [(*table, k) for table, k in zip(tables, stiffnesses, strict=True) if not k.is_zero]
    if not kept:
        return Off("every stiffness is 0" if spring else "there is no spring")
    start = world.start()
    rows, ends, lengths, slack = [], [], [], []
    for name, keys, stiffness in kept:
        vertices = selected_vertices(f"{name}.select", world, keys["select"])
        if not len(vertices):
            raise InputError(f"{name} selects no vertex.")
        places = _places(name, keys, world, start[vertices], stiffness)
        distances = np.linalg.norm(start[vertices] - places.start, axis=1)
        given = as_positive(f"{name}.rest_length", keys.get("rest_length", 0.0), zero=True)
        lengths.append(np.full(len(vertices), given) if "rest_length" in keys else distances)
        slack.append(np.full(len(vertices), as_flag(f"{name}.slack", keys.get("slack", False))))
        rows.append(vertices)
        ends.append(places)
    tied = np.concatenate(rows)
    first = np.concatenate([places.start for places in ends])
    levels = np.concatenate([np.full(len(p.start), p.stiffness.at(0.0)) for p in ends])
    ones = np.ones((len(tied), 1))
    return Springs(tied[:, None], ones, first, np.concatenate(lengths), levels, np.concatenate(slack), tuple(ends))


def _places(name: str, keys: Mapping[str, Any], world: World, start: Floats, stiffness: Schedule) -> Places:
    """Where the springs of a table end; start (k, 3) [m] are its vertices."""
    if "to" in keys and "offset" in keys:
        raise InputError(f"{name} has to and offset.", "Give one of them.")
    if "to" in keys:
        places = np.tile(as_vector(f"{name}.to", keys["to"]) - world.origin, (len(start), 1))
    else:
        places = start + as_vector(f"{name}.offset", keys.get("offset", (0, 0, 0)))
    frames = as_points(f"{name}.path", keys.get("path", [[0.0, 0.0, 0.0, 0.0]]), 4)
    late = np.flatnonzero(np.diff(frames[:, 0]) <= 0)
    if late.size:
        raise InputError(f"{name}.path[{late[0] + 1}] is not after the key frame before it.", "Put them in order.")
    motion = keys.get("motion", {})
    if not isinstance(motion, Mapping):
        raise InputError(f"{name}.motion must be a table of keys, not {motion!r}.")
    centred = {"centre": places.mean(axis=0) + world.origin, **motion}
    return Places(places, motion_of(f"{name}.motion", centred, world.origin), frames[:, 0], frames[:, 1:], stiffness)


_CORNERS = {"select": "corners"}
EXAMPLE = Example(
    keys={"spring": [{"select": "left", "stiffness": 2.0, "to": [0.0, 0.0, 1.0], "rest_length": 0.6}]},
    in_scene={"spring": [{**_CORNERS, "stiffness": 5.0}]},
    zero={"spring": [{**_CORNERS, "stiffness": 0}]},
    external=True,
    idle=Idle(
        always={"spring": [{**_CORNERS, "stiffness": [[0.0, 0.0], [10.0, 0.0], [11.0, 30.0]]}]},
        sometimes={"spring": [{**_CORNERS, "stiffness": [[0.0, 0.0], [0.05, 0.0], [0.06, 20.0]]}]},
    ),
)
