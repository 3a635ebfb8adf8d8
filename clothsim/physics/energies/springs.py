"""Springs, tethers and soft pins between vertices and positions in space: the effect `springs`.

E = k/2 (|x - c| - L)^2 for each vertex (`links`), k [N/m] a vertex, c constant or moving. With L = 0 a spring is a soft
pin: the force k |x - c| draws its vertex to c, where a pin prescribes it. A tether (slack = true) acts where it is
longer than L; elsewhere it contributes exactly nothing.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from clothsim.base.arrays import Floats, Ints, as_points
from clothsim.base.errors import InputError
from clothsim.keys.effect_tables import Spring
from clothsim.keys.typed_effects import Springs
from clothsim.mesh.body import RigidMotion, prescribed_motion
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Energy, Off, Step
from clothsim.physics.energies.example import Example, Idle
from clothsim.physics.energies.key_values import Schedule, schedule, selected_vertices
from clothsim.physics.energies.links import Links
from clothsim.physics.energies.protocols import Anchored, Driven, NoPastSensitivity


@dataclass(frozen=True)
class SpringAnchors:
    """End positions c of the springs of one table over time: a rigid motion of `start`, then a translation.

    Parameters
    ----------
    start : (k, 3) array
        Positions at time 0 [m].
    motion : RigidMotion
        Prescribed motion.
    times, shifts : (f,) and (f, 3) arrays
        Key frames of the translation [s], [m], linear between them.
    stiffness : Schedule
        [N/m].
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
        """The positions at `time` [s], (k, 3) [m]."""
        shift = [np.interp(time, self.times, self.shifts[:, axis]) for axis in range(3)]
        return self.motion.apply(self.start, time) + np.array(shift)


@dataclass(frozen=True)
class SpringsEnergy(Links, Anchored, Driven, NoPastSensitivity):
    """Links of single vertices; `anchors`: the end positions of each table's springs over time."""

    anchors: tuple[SpringAnchors, ...]

    @property
    def drives(self) -> bool:
        """True where an anchor moves or a stiffness changes."""
        return not all(anchors.still for anchors in self.anchors)

    @property
    def anchored_rows(self) -> Ints:
        """The tied vertices, (m,)."""
        return self.rows[:, 0]

    def begin(self, step: Step) -> Self:
        """A copy with the anchors and stiffnesses of the end of the step."""
        now = step.time + step.dt
        levels = [np.full(len(anchors.start), anchors.stiffness.at(now)) for anchors in self.anchors]
        return replace(
            self,
            targets=np.concatenate([anchors.at(now) for anchors in self.anchors]),
            stiffnesses=np.concatenate(levels),
        )


def springs(world: World, keys: Springs) -> Energy | Off:
    """Springs of the tables of a scene; off where every stiffness is 0.

    Raises
    ------
    InputError
        Names the table and key.
    """
    tables = [(f"effects.springs.spring[{k}]", each) for k, each in enumerate(keys.spring)]
    stiffnesses = [schedule(f"{name}.stiffness", each.stiffness, 0.0) for name, each in tables]
    selected = [(*table, k) for table, k in zip(tables, stiffnesses, strict=True) if not k.is_zero]
    if not selected:
        return Off("every stiffness is 0" if tables else "there is no spring")
    start = world.start()
    rows, ends, lengths, slack = [], [], [], []
    for name, each, stiffness in selected:
        vertices = selected_vertices(f"{name}.select", world, each.select)
        if not len(vertices):
            raise InputError(f"{name} selects no vertex.")
        anchors = _anchors(name, each, world, start[vertices], stiffness)
        distances = np.linalg.norm(start[vertices] - anchors.start, axis=1)
        lengths.append(distances if each.rest_length is None else np.full(len(vertices), each.rest_length))
        slack.append(np.full(len(vertices), each.slack))
        rows.append(vertices)
        ends.append(anchors)
    tied = np.concatenate(rows)
    first = np.concatenate([anchors.start for anchors in ends])
    levels = np.concatenate([np.full(len(anchors.start), anchors.stiffness.at(0.0)) for anchors in ends])
    links = tied[:, None], np.ones((len(tied), 1)), first, np.concatenate(lengths), levels, np.concatenate(slack)
    return SpringsEnergy(*links, tuple(ends))


def _anchors(name: str, keys: Spring, world: World, start: Floats, stiffness: Schedule) -> SpringAnchors:
    """The anchors of a table; start (k, 3): positions of its vertices [m]."""
    if keys.to is not None and "offset" in keys.given:
        raise InputError(f"{name} has both to and offset.", "Give one of them.")
    if keys.to is not None:
        ends = np.tile(np.array(keys.to, np.float64) - world.origin, (len(start), 1))
    else:
        ends = start + np.array(keys.offset, np.float64)
    frames = as_points(f"{name}.path", keys.path if len(keys.path) else [[0.0, 0.0, 0.0, 0.0]], 4)
    late = np.flatnonzero(np.diff(frames[:, 0]) <= 0)
    if late.size:
        raise InputError(f"{name}.path[{late[0] + 1}] is not after the key frame before it.", "Sort them by time.")
    motion = prescribed_motion(keys.motion, ends.mean(axis=0) + world.origin, world.origin)
    return SpringAnchors(ends, motion, frames[:, 0], frames[:, 1:], stiffness)


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
