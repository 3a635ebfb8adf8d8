"""Creases and pleats, lines with a rest angle: the effect `rest_angle`.

The hinges along a crease have the rest angle that the scene gives, constant or over time; their stiffness remains that
of the bending model, so that a crease resists loads no more than the cloth resists bending. Two flat panels joined by
one crease are at rest at exactly its angle, whatever the stiffness is. Angle 0 is flat; a positive angle folds the
cloth towards its back.

A line is snapped to the edges of the mesh (`mesh.lines`): along rows of a grid it is exact; across a mesh it
zigzags, and hinges off one line cannot all rotate by the angle without stretch: draw creases along edges.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from scipy import sparse

from clothsim.base.arrays import Ints, as_points
from clothsim.base.errors import InputError
from clothsim.base.linalg import dot
from clothsim.keys.effect_tables import Crease
from clothsim.keys.typed_effects import RestAngle
from clothsim.mesh.lines import path_along
from clothsim.mesh.topology import unique_edges
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Energy, Off, Step
from clothsim.physics.energies.example import Example, Idle
from clothsim.physics.energies.hinge_moments import BendingModel, ShiftedAngles, hinges_of_bending
from clothsim.physics.energies.key_values import Schedule, cloth_number, of_pattern, schedule, vertex_numbers
from clothsim.physics.energies.protocols import Driven

LINES = ("through", "vertices", "panel", "label")
"""Keys of which a crease has one."""


def rest_angle(world: World, keys: RestAngle, *, built: Mapping[str, Energy] | None = None) -> Energy | Off:
    """Creases of the tables of a scene; off without creases or bending, or where all is flat.

    built: the energies built so far, with the bending whose angles are shifted.

    Raises
    ------
    InputError
        For a crease on no edge, at a border, on another crease's edge, or of 180 degrees and more.
    """
    if not keys.crease:
        return Off("there is no crease")
    bending = (built or {}).get("bending")
    if bending is None:
        return Off("the scene has no bending")
    hinges = hinges_of_bending("rest_angle", bending)
    creases = [(f"effects.rest_angle.crease[{k}]", crease) for k, crease in enumerate(keys.crease)]
    rows = [_hinges_along(name, world, crease, hinges) for name, crease in creases]
    schedules = tuple(schedule(f"{name}.angle_degrees", crease.angle_degrees) for name, crease in creases)
    for angle in schedules:
        for time in angle.times:
            radians(angle, time)
    chosen = np.concatenate(rows)
    twice = np.flatnonzero(np.bincount(chosen) > 1)
    if twice.size:
        a, b = hinges.vertices[twice[0], :2]
        raise InputError(f"effects.rest_angle creases the edge {a}-{b} twice.", "Give each edge one angle.")
    if not hinges.rest_angles[chosen].any() and all(angle.is_zero for angle in schedules):
        return Off("every crease is flat, as is the cloth at rest")
    return rest_angles(hinges, chosen, schedules, tuple(map(len, rows)))


def _hinges_along(name: str, world: World, keys: Crease, hinges: BendingModel) -> Ints:
    """The numbers of the hinges along a crease."""
    if sum(key in keys.given for key in LINES) != 1 or (keys.panel is None) != (keys.edge is None):
        raise InputError(
            f"{name} needs either through, vertices, panel with edge, or label.",
            "Such as through = [[x, y, z], [x, y, z]].",
        )
    if keys.panel is not None or keys.label is not None:
        return _hinges_of_pattern(name, world, keys, hinges)
    number = cloth_number(name, world, keys.cloth)
    cloth, first = world.cloths[number], world.cloth_slices[number].start
    edges = unique_edges(cloth.triangles)
    bent = np.sort(hinges.vertices[:, :2], axis=1)
    if "vertices" in keys.given:
        group = vertex_numbers(f"{name}.vertices", keys.vertices, len(cloth.positions)) + first
        selected = np.flatnonzero(np.isin(bent, group).all(axis=1))
        if not len(selected):
            raise InputError(f"{name} has no interior edge.", "Give neighbouring vertices inside the cloth.")
        return selected
    points = as_points(f"{name}.through", keys.through)
    path = path_along(f"{name}.through", cloth.rest_positions, edges, points)
    if len(path) < 2:
        raise InputError(f"{name}.through begins and ends at the vertex {path[0]}.", "Give a longer line.")
    along = np.sort(np.column_stack([path[:-1], path[1:]]), axis=1)
    numbers, wanted = ((pairs * [world.n_vertices, 1]).sum(axis=1) for pairs in (bent, along + first))
    order = np.argsort(numbers)
    selected = order[np.minimum(np.searchsorted(numbers, wanted, sorter=order), len(order) - 1)]
    for a, b in along[numbers[selected] != wanted][:1]:
        raise InputError(f"{name}: the edge {a}-{b} has no hinge.", "Draw the crease along interior edges.")
    return selected


def _hinges_of_pattern(name: str, world: World, keys: Crease, hinges: BendingModel) -> Ints:
    """The numbers of the hinges along welded edges of a sewing pattern."""
    select: dict[str, Any] = {key: getattr(keys, key) for key in ("panel", "edge", "label") if key in keys.given}
    of_pattern(name, world, select)  # refuses names that no cloth has
    pairs = []
    for number, (cloth, rows) in enumerate(zip(world.cloths, world.cloth_slices, strict=True)):
        if keys.cloth is None or number == cloth_number(name, world, keys.cloth):
            own = [(str(keys.panel), keys.edge or 0)]
            edges = own if keys.label is None else cloth.lines.labels.get(keys.label, ())
            pairs.append(cloth.lines.segments(edge for edge in edges if edge in cloth.lines.edges) + rows.start)
    along = np.sort(np.concatenate(pairs), axis=1) @ [world.n_vertices, 1]
    found = np.flatnonzero(np.isin(np.sort(hinges.vertices[:, :2], axis=1) @ [world.n_vertices, 1], along))
    if not len(found):
        raise InputError(
            f"{name}: no hinge lies along {select}.",
            "An edge bends where it is welded to another one: place both so that they touch.",
        )
    return found


_LINE = {"through": [[0.0, -0.5, 0.0], [0.0, 0.5, 0.0]]}
EXAMPLE = Example(
    keys={"crease": [{"vertices": [1, 4, 7, 10], "angle_degrees": [[0.0, 10.0], [2.0, 70.0]]}]},
    in_scene={"crease": [{**_LINE, "angle_degrees": 20.0}]},
    zero={"crease": [{**_LINE, "angle_degrees": 0}]},
    idle=Idle(
        always={"crease": [{**_LINE, "angle_degrees": [[0.0, 0.0], [10.0, 0.0], [11.0, 30.0]]}]},
        sometimes={"crease": [{**_LINE, "angle_degrees": [[0.0, 0.0], [0.05, 0.0], [0.06, 20.0]]}]},
    ),
)


# With the shifts s of the rest angles and the bending energy (theta - theta0)' K (theta - theta0)/2 the moments are K s
# (`hinge_moments`): in the mid-edge model those of the hinges around a crease too.


@dataclass(frozen=True)
class RestAngleEnergy(ShiftedAngles, Driven):
    """Shifted rest angles along creases.

    Parameters
    ----------
    stiffness : (h, k) sparse array
        Columns of K [N m].
    schedules : tuple of Schedule
        Rest angle of each crease [degrees].
    counts_of_hinges : tuple of int
        Number of hinges along each crease.
    """

    stiffness: sparse.csr_array
    schedules: tuple[Schedule, ...]
    counts_of_hinges: tuple[int, ...]

    @property
    def drives(self) -> bool:
        """True where a rest angle varies over time, which does external work."""
        return not all(angle.is_constant for angle in self.schedules)

    def begin(self, step: Step) -> Self:
        """A copy with the rest angles of the end of the step; a quasi-static ramp scales constant ones."""
        now = step.time + step.dt
        goals = np.repeat([radians(angle, now) for angle in self.schedules], self.counts_of_hinges)
        loads = np.repeat([step.load if a.is_constant else 1.0 for a in self.schedules], self.counts_of_hinges)
        shifts = loads * (goals - self.references[: len(goals)])
        moments = self.stiffness @ shifts
        return replace(self, shifts=shifts, moments=moments, offset=0.5 * dot(moments[: len(goals)], shifts))


def rest_angles(
    bending: BendingModel, chosen: Ints, schedules: tuple[Schedule, ...], counts: tuple[int, ...]
) -> RestAngleEnergy:
    """Creases along the hinges `chosen` (k,) of a bending energy, `counts` of them for each schedule."""
    # of K = B' w B [N m], those of the chosen hinges, as rows
    strains, weights = bending.strains_of_angles()
    own = sparse.diags_array(np.repeat(weights, strains.shape[0] // len(weights))) @ strains
    columns = (strains.T.tocsr()[chosen] @ own).tocsr()
    around = np.concatenate([chosen, np.setdiff1d(columns.indices, chosen)])
    rest, none = bending.rest_angles[around], np.zeros(len(around))
    moments = bending.vertices[around], rest, none, 0.0
    return RestAngleEnergy(*moments, chosen, none[: len(chosen)], columns.T.tocsr()[around], schedules, counts)


def radians(angle: Schedule, time: float) -> float:
    """The rest angle at `time` [s] in radians. InputError for half a turn and more."""
    degrees = angle.at(time)
    if not abs(degrees) < 180:
        raise InputError(f"{angle.name} is {degrees:g} at {time:g} s.", "Give less than 180 degrees.")
    return float(np.radians(degrees))
