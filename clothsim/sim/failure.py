"""Why a run cannot go on: the cause, the element by its name, the place, and what to do."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from clothsim.arrays import Floats
from clothsim.energies.constraint import Constraint, Prescribed
from clothsim.energies.protocols import report_of
from clothsim.mesh.world import World
from clothsim.sim.closest_contact import ContactPair, closest_contact_pair
from clothsim.sim.state import State
from clothsim.sim.vertex_names import simplex_name, vertex_name
from clothsim.solve.newton import NewtonResult
from clothsim.solve.outcome import Ending, Outcome
from clothsim.solve.potential import Potential

if TYPE_CHECKING:
    from clothsim.intersection.crossings import Crossing


@dataclass(frozen=True)
class Failure:
    """What stopped a run in its step number `step` (from 1) at `time` [s], with dt [s].

    cause: a word or two; sentence: what happened; element: by its names, empty where it has none; position: its place
    (3,) [m] in the user's coordinates, or None; remedy: a sentence; tries: how often the step was tried, in words.
    """

    cause: str
    sentence: str
    element: str
    position: Floats | None
    remedy: str
    step: int
    time: float
    dt: float
    tries: str = ""

    @property
    def reason(self) -> str:
        """One or two sentences for people."""
        return f"At {self.time:.4g} s: {self.sentence} {self.tries}".strip()

    def as_dict(self) -> dict[str, Any]:
        """As the summary keeps it."""
        names = ("cause", "sentence", "element", "position", "remedy", "step", "time", "dt")
        return {name: getattr(self, name) for name in names}


def failure_of(
    world: World,
    constraints: Collection[Constraint],
    potential: Potential,
    state: State,
    result: NewtonResult,
    target: Prescribed,
    dts: Sequence[float],
    infeasible: bool,
) -> Failure:
    """The failure of a step from `state` that was tried with `dts` [s] and ended last in `result`.

    potential: bound to the last try; target: where its prescribed vertices were to be; infeasible: the scripted motion
    was blocked at the same place again and again.
    """
    end = result.outcome
    pair = None
    if end.ending in (Ending.BLOCKED, Ending.NO_ROOM):
        pair = closest_contact_pair(world, potential.energies.values(), result.x)
    sentence = _said(world, constraints, end, pair)
    if pair is None and end.ending in (Ending.BLOCKED, Ending.NO_ROOM):
        tight = (report_of(energy).tightest(result.x) for energy in potential.energies.values())
        sentence = "; ".join([sentence.removesuffix("."), *filter(None, tight)]) + "."
    tries = f"dt fell to {dts[-1]:.2g} s."
    if infeasible:
        tries = f"{state.blocked} tries with ever smaller dt, down to {dts[-1]:.2g} s, ended there: it is infeasible."
    if pair is not None:
        element = " and ".join(_sides(world, constraints, pair))
    else:
        element = "" if end.row is None else vertex_name(world, constraints, end.row)
    position = end.position if pair is None else pair.position
    position = None if position is None else position + world.origin
    if end.ending is Ending.BLOCKED:
        remedy = _unblock(world, _movers(world, constraints, result.x, target), pair)
    else:
        remedy = _remedy(world, end, pair, inertia=_resisted(potential))
    return Failure(end.ending.cause, sentence, element, position, remedy, state.step + 1, state.time, dts[-1], tries)


def crossing_failure(world: World, found: "Crossing", state: State, dt: float) -> Failure:
    """The failure of a run in whose frame something intersects that contact should have kept apart."""
    crossing = replace(found, position=found.position + world.origin)
    i, j = crossing.pairs[0]
    element = f"triangle {i} of {crossing.first} and triangle {j} of {crossing.second}"
    remedy = "Contact should have prevented that: please report it with what `clothsim bundle` makes of the run."
    sentence = f"{crossing.sentence}."
    return Failure("intersection", sentence, element, crossing.position, remedy, state.step, state.time, dt)


def told(world: World, constraints: Collection[Constraint], end: Outcome) -> str:
    """The sentence of an end, its vertex by name."""
    if end.row is None or end.position is None:
        return end.sentence
    return end.told(vertex_name(world, constraints, end.row), end.position + world.origin)


def _said(world: World, constraints: Collection[Constraint], end: Outcome, pair: ContactPair | None) -> str:
    """The sentence of the end, and who touches there."""
    if pair is None:
        return told(world, constraints, end)
    one, other, third = _objects(world, pair)
    if third:
        clause = f"{one} is pinched between {other} and {third}"
    else:
        first, second = _sides(world, constraints, pair)
        clause = f"{first} and {second} are {pair.gap:.2g} m apart"
    row = -1 if end.row is None else end.row
    if end.ending is Ending.BLOCKED and row >= world.n_cloth and world.labels[row] >= 0:
        start = end.told(
            _driver(world, constraints, row), pair.position + world.origin
        )  # of a body no vertex is more blocked than others
    else:
        start = told(world, constraints, end)
    return f"{start.removesuffix('.')}; {clause}."


def _remedy(world: World, end: Outcome, pair: ContactPair | None, inertia: bool) -> str:
    """What to do where no script is to blame."""
    if end.ending is Ending.NO_ROOM and pair is not None:
        one, other, third = _objects(world, pair)
        return f"Leave {one} more room between {other} and {third or one}, or bring them together more slowly."
    held = "" if inertia else " Without effects.inertia every cloth must be held, by pins or by a body under it."
    return f"{_REMEDIES[end.ending]}{held}"


_REMEDIES = {
    Ending.NO_ROOM: "Take a smaller solver.dt, or start the scene with more room there.",
    Ending.LINE_SEARCH: "Take a larger solver.tolerance or a smaller solver.dt: round-off hides what is left to gain.",
    Ending.NOT_FINITE: "Let `clothsim check` look for a triangle that starts as a line; else take a smaller solver.dt.",
    Ending.ITERATION_LIMIT: "Take a smaller solver.dt, a larger solver.tolerance or more solver.max_iterations.",
    Ending.SINGULAR: "Let something resist every motion of the cloth: effects.inertia, or pins and a membrane.",
}


def _unblock(world: World, movers: Sequence[str], pair: ContactPair | None) -> str:
    """How a scripted motion may go on."""
    who = " and ".join(movers)
    if pair is None:
        return f"Shorten or slow the motion of {who}: the cloth cannot follow it."
    one, other, third = _objects(world, pair)
    if third:
        return f"Let {other} and {third} close less, or slide {one} out from between them first."
    obstacle = one if other in movers else other
    if one == other or len(movers) > 1:
        return f"Shorten the motion of {who}: {one} has no room left."
    return f"Shorten the motion of {who}, or move {obstacle} out of its way."


def _movers(world: World, constraints: Collection[Constraint], x: Floats, target: Prescribed) -> list[str]:
    """Who is kept from going where it should: groups of pins, and bodies."""
    left = np.linalg.norm(target.positions - x[target.vertices], axis=1)
    rows = target.vertices[left > 0.5 * left.max()]
    bodies = rows[(rows >= world.n_cloth) & (world.labels[rows] >= 0)]
    names = [world.names[label] for label in np.unique(world.labels[bodies])]
    return [*dict.fromkeys(_driver(world, constraints, int(row)) for row in np.setdiff1d(rows, bodies)), *names]


def _driver(world: World, constraints: Collection[Constraint], row: int) -> str:
    """What carries a prescribed row of x: a group of pins, or the body itself."""
    holders = (constraint.holder(row) for constraint in constraints)
    return next(filter(None, holders), world.names[world.labels[row]])


def _objects(world: World, pair: ContactPair) -> tuple[str, str, str]:
    """The names of who touches, a cloth first, and of the third in a pinch (else empty)."""
    labels = sorted(int(world.labels[rows[0]]) for rows in (pair.first, pair.second))
    return world.names[labels[0]], world.names[labels[1]], "" if pair.pinch is None else world.names[pair.pinch]


def _sides(world: World, constraints: Collection[Constraint], pair: ContactPair) -> tuple[str, str]:
    """Both simplices by name, the cloth's first."""
    sides = sorted((pair.first, pair.second), key=lambda rows: int(world.labels[rows[0]]))
    return simplex_name(world, constraints, sides[0]), simplex_name(world, constraints, sides[1])


def _resisted(potential: Potential) -> bool:
    """True where inertia or damping resists every motion (friction, which begins last, only that of contacts)."""
    return any(energy.incremental and not energy.begins_last for energy in potential.energies.values())
