"""Failure of a step: its cause, the mesh element, the position, and a remedy."""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Constraint, Energy, Prescribed
from clothsim.physics.energies.protocols import report_of
from clothsim.solve.newton.newton import NewtonResult
from clothsim.solve.newton.outcome import Ending, Outcome
from clothsim.solve.newton.potential import Potential
from clothsim.solve.stepping.state import State

if TYPE_CHECKING:
    from clothsim.geometry.intersection.crossings import Crossing

# Closest contact pair, and detection of a pinch: two objects that close on a cloth from both sides.

PINCH_RADIUS = 2.0
"""Distance, in median cloth edges, within which another contact pair belongs to the same pinch."""


@runtime_checkable
class HasContactPairs(Protocol):
    """Contact energy with the pairs of distinct closest features and their closest points."""

    def distinct(self, x: Floats) -> Any:
        """Return the pairs, of which the first `n_points` are of a point and a triangle."""

    @property
    def stiffness(self) -> float:
        """Barrier stiffness [Pa]."""

    def normal_forces(self, x: Floats, stiffness: float) -> tuple[Ints, Floats, Floats, Floats]:
        """Return rows (p, 4), weights (p, 4), connecting lines (p, 3) [m] and forces (p,) [N] of the closest points."""


@dataclass(frozen=True)
class ContactPair:
    """Two simplices of x at their closest.

    Parameters
    ----------
    first, second : (1..3,) int64
        Rows of x of both simplices.
    place : (3,) float64
        Point between them [m].
    gap : float
        Distance [m].
    pinch : int or None
        Label of a third object that closes on the same point from elsewhere.
    """

    first: Ints
    second: Ints
    position: Floats
    gap: float
    pinch: int | None


def closest_contact_pair(world: World, energies: Iterable[Energy], x: Floats) -> ContactPair | None:
    """Return the closest pair of all contact energies at x (N, 3) [m]; None where no pair is active."""
    found = []
    for energy in energies:
        if isinstance(energy, HasContactPairs):
            rows, weights, lines, _ = energy.normal_forces(x, energy.stiffness)
            splits = np.where(np.arange(len(rows)) < energy.distinct(x).n_points, 1, 2)
            on_first = np.where(np.arange(4) < splits[:, None], weights, 0.0)
            midpoints = np.einsum("pk,pkc->pc", np.abs(on_first), x[rows]) - 0.5 * lines
            found.append((rows, splits, midpoints, np.linalg.norm(lines, axis=1)))
    rows, splits, midpoints, distances = (
        (np.concatenate(parts) for parts in zip(*found, strict=True)) if found else _NONE
    )
    if not len(rows):
        return None
    best = int(distances.argmin())
    pair, split = rows[best], int(splits[best])
    objects = world.labels[rows[:, [0, 3]]]
    ends = x[world.edges]
    edge = float(np.median(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)))
    active = np.linalg.norm(midpoints - midpoints[best], axis=1) <= PINCH_RADIUS * edge
    elsewhere = ~np.isin(objects, objects[best])
    closing = np.flatnonzero(active & elsewhere.any(axis=1))
    third = closing[distances[closing].argmin()] if len(closing) else None
    pinch = None if third is None else int(objects[third][elsewhere[third]][0])
    return ContactPair(pair[:split], pair[split:], midpoints[best], float(distances[best]), pinch)


_NONE = (np.zeros((0, 4), np.int64), np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros(0))


# Names of rows of x as the scene gives them: "vertex 17 of cloth (pins)", "triangle 4 of ball".


def vertex_name(world: World, constraints: Iterable[Constraint], row: int) -> str:
    """Return the name of a row of x: its number in its object, and the constraint that prescribes it in brackets."""
    label = int(world.labels[row])
    of_rigid = (
        body.name
        for body, at in zip(world.rigid, world.coordinate_slices, strict=True)
        if row in range(at.start, at.stop)
    )
    if moving := next(of_rigid, ""):
        return moving
    holder = next(filter(None, (constraint.holder(row) for constraint in constraints)), "")
    if label < 0:
        return f"the clamped edge of {holder}"
    held = f" ({holder})" if holder else ""
    return f"vertex {row - first_row(world, label)} of {world.names[label]}{held}"


def simplex_name(world: World, constraints: Iterable[Constraint], rows: Ints) -> str:
    """Return the name of a vertex, an edge or a triangle, `rows (1..3,)` of x, by its number in its object."""
    if len(rows) == 1:
        return vertex_name(world, constraints, int(rows[0]))
    label = int(world.labels[rows[0]])
    own = rows - first_row(world, label)
    if len(rows) == 2:
        return f"edge {own[0]}-{own[1]} of {world.names[label]}"
    triangles = [thing.triangles for thing in world.cloths] + [thing.triangles for thing in world.bodies]
    alike = (np.sort(triangles[label], axis=1) == np.sort(own)).all(axis=1)
    return f"triangle {int(alike.argmax())} of {world.names[label]}"


def first_row(world: World, label: int) -> int:
    """Return the row of x of the first vertex of an object."""
    return (*world.cloth_slices, *world.body_slices)[label].start


class Cause(StrEnum):
    """Causes of a failure: the ends of a Newton solve but convergence, an intersection in a frame, a spent budget."""

    ITERATION_LIMIT = "iteration limit"
    LINE_SEARCH = "line search"
    UNBALANCED = "force balance"
    NO_ROOM = "no room"
    BLOCKED = "blocked"
    SUNK = "contact too soft"
    NOT_FINITE = "not finite"
    SINGULAR = "singular"
    INTERSECTION = "intersection"
    BUDGET = "budget"


@dataclass(frozen=True)
class Failure:
    """Failure that stopped a run.

    Parameters
    ----------
    cause : Cause
        Cause, as the summary keeps it.
    sentence : str
        Message with numbers and names.
    element : str
        Mesh elements by name, such as "vertex 17 of cloth"; empty where there is none.
    position : (3,) float64 or None
        Position of the failure in the coordinates of the scene [m].
    remedy : str
        Changes of the scene that may help.
    step : int
        Number of the step, from 1.
    time : float
        Time at its start [s].
    dt : float
        Length of its last try [s].
    tries : str
        Message about its tries.
    """

    cause: Cause
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
        """Time, message and tries, for the user."""
        return f"At {self.time:.4g} s: {self.sentence} {self.tries}".strip()

    def as_dict(self) -> dict[str, Any]:
        """Return the entry of the summary."""
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
    """Describe the failure of a step from `state`.

    Parameters
    ----------
    world, constraints, potential
        Meshes, Dirichlet constraints, and the potential bound to the last try.
    state : State
        Start of the step.
    result : NewtonResult
        Last solve.
    target : Prescribed
        Positions of its prescribed vertices at the end of the step.
    dts : sequence of float
        Lengths of the tries [s].
    infeasible : bool
        True where the prescribed motion was blocked repeatedly at the same point.
    """
    end = result.outcome
    pair = None
    if end.ending in (Ending.BLOCKED, Ending.NO_ROOM):
        pair = closest_contact_pair(world, potential.energies.values(), result.x)
    sentence = _sentence(world, constraints, end, pair)
    tight = []
    if pair is None and end.ending in (Ending.BLOCKED, Ending.NO_ROOM, Ending.NOT_FINITE):
        tight = [*filter(None, (report_of(energy).tightest(result.x) for energy in potential.energies.values()))]
        sentence = "; ".join([sentence.removesuffix("."), *tight]) + "."
    tries = f"dt was halved down to {dts[-1]:.2g} s."
    if infeasible:
        tries = f"{state.blocked} tries with dt down to {dts[-1]:.2g} s ended there: the motion is infeasible."
    if pair is not None:
        element = " and ".join(_names(world, constraints, pair))
    else:
        element = "" if end.row is None else vertex_name(world, constraints, end.row)
    position = end.position if pair is None else pair.position
    position = None if position is None else position + world.origin
    if end.ending is Ending.BLOCKED:
        left = np.linalg.norm(target.positions - result.x[target.vertices], axis=1)
        rows = target.vertices[left > 0.5 * left.max()]
        bodies = rows[(rows >= world.n_cloth) & (world.labels[rows] >= 0)]
        drivers = dict.fromkeys(_driver(world, constraints, int(row)) for row in np.setdiff1d(rows, bodies))
        movers = [*drivers, *(world.names[label] for label in np.unique(world.labels[bodies]))]
        remedy = _unblock(world, movers, pair)
    elif tight and end.ending is Ending.NOT_FINITE:
        remedy = "Let the rest shape or the limit change more slowly, or set a larger limit."
    else:
        remedy = _remedy(world, end, pair, potential, constraints)
    return Failure(
        Cause[end.ending.name], sentence, element, position, remedy, state.step + 1, state.time, dts[-1], tries
    )


def crossing_failure(crossing: "Crossing", state: State, dt: float) -> Failure:
    """Describe the failure of a run in whose step surfaces intersect in spite of contact."""
    i, j = crossing.pairs[0]
    element = f"triangle {i} of {crossing.first} and triangle {j} of {crossing.second}"
    remedy = "Contact should have prevented it: please report it with the archive that `clothsim bundle` makes."
    sentence = f"{crossing.sentence}."
    return Failure(Cause.INTERSECTION, sentence, element, crossing.position, remedy, state.step, state.time, dt)


def budget_failure(state: State, duration: float, dt: float) -> Failure:
    """Describe the end of a run that spent its CPU time before its duration [s]."""
    sentence = f"The budget of CPU time is spent with {duration - state.time:.3g} s left to simulate."
    remedy = "Set a larger run.budget, or go on with `clothsim resume`."
    return Failure(Cause.BUDGET, sentence, "", None, remedy, state.step, state.time, dt)


def try_sentence(world: World, constraints: Collection[Constraint], potential: Potential, result: NewtonResult) -> str:
    """Return the message of a failed solve; of a blocked motion the closest contact pair, not what is held farthest."""
    pair = None
    if result.outcome.ending is Ending.BLOCKED:
        pair = closest_contact_pair(world, potential.energies.values(), result.x)
    return _sentence(world, constraints, result.outcome, pair)


def _end_sentence(world: World, constraints: Collection[Constraint], end: Outcome) -> str:
    """Return the message of an outcome, its vertex by name and its position in the coordinates of the scene."""
    if end.row is None or end.position is None:
        return end.sentence
    return end.describe(vertex_name(world, constraints, end.row), end.position + world.origin)


def _sentence(world: World, constraints: Collection[Constraint], end: Outcome, pair: ContactPair | None) -> str:
    """Message of the outcome, and the contact pair or the pinch there."""
    if pair is None:
        return _end_sentence(world, constraints, end)
    one, other, third = _objects(world, pair)
    if third:
        clause = f"{one} is pinched between {other} and {third}"
    else:
        first, second = _names(world, constraints, pair)
        clause = f"{first} and {second} are {pair.gap:.2g} m apart"
    row = -1 if end.row is None else end.row
    if end.ending is Ending.BLOCKED and row >= world.n_cloth and world.labels[row] >= 0:
        start = end.describe(
            _driver(world, constraints, row), pair.position + world.origin
        )  # all vertices of a body are equally blocked
    else:
        start = _end_sentence(world, constraints, end)
    return f"{start.removesuffix('.')}; {clause}."


def _remedy(
    world: World,
    end: Outcome,
    pair: ContactPair | None,
    potential: Potential,
    constraints: Collection[Constraint],
) -> str:
    """Remedy where no prescribed motion is the cause; it names no effect that the scene has."""
    if end.ending is Ending.NO_ROOM and pair is not None:
        one, other, third = _objects(world, pair)
        return f"Leave a larger gap for {one} between {other} and {third or one}, or let them approach more slowly."
    # inertia or damping resists every motion; friction, which begins last, only that of contacts
    inertia = any(energy.incremental and not energy.depends_on_other_energies for energy in potential.energies.values())
    if end.ending is Ending.SINGULAR:
        return _resist(potential, constraints, inertia)
    held = "" if inertia else " Without effects.inertia every cloth must be held, by pins or by a body under it."
    return f"{_REMEDIES[end.ending]}{held}"


def _resist(potential: Potential, constraints: Collection[Constraint], inertia: bool) -> str:
    """Remedy for a singular Newton matrix: what the scene lacks; where it lacks nothing, its numbers are the cause."""
    if inertia:
        return (
            "Look for a load or a stiffness that is many powers of ten from the others; else set a smaller solver.dt."
        )
    lacking = [] if constraints else ["pins"]
    lacking += [] if "membrane" in potential.energies else ["membrane"]
    alternative = f", or {' and '.join(f'effects.{name}' for name in lacking)}" if lacking else ""
    return f"Add an effect that resists every motion of the cloth: effects.inertia{alternative}."


_REMEDIES = {
    Ending.UNBALANCED: (
        "Set a larger d_hat of the contacts or a smaller stiffness of the cloth: the forces there are beyond what "
        "positions in double precision can balance. Else set a smaller solver.dt."
    ),
    Ending.NO_ROOM: "Set a smaller solver.dt, or start the scene with larger gaps there.",
    Ending.SUNK: "Set a larger contact stiffness of the effect.",
    Ending.LINE_SEARCH: "Set a larger solver.tolerance or a smaller solver.dt: the decrease of E is below round-off.",
    Ending.NOT_FINITE: "Run `clothsim check` on the scene to find degenerate triangles; else set a smaller solver.dt.",
    Ending.ITERATION_LIMIT: "Set a smaller solver.dt, a larger solver.tolerance or a larger solver.max_iterations.",
}


def _unblock(world: World, movers: Sequence[str], pair: ContactPair | None) -> str:
    """Remedy for a blocked prescribed motion."""
    who = " and ".join(movers)
    if pair is None:
        return f"Shorten or slow the motion of {who}: the cloth cannot follow it."
    one, other, third = _objects(world, pair)
    if third:
        return f"Let {other} and {third} approach less, or move {one} out from between them first."
    obstacle = one if other in movers else other
    if one == other or len(movers) > 1:
        return f"Shorten the motion of {who}: {one} has no admissible displacement left."
    return f"Shorten the motion of {who}, or move {obstacle} out of its path."


def _driver(world: World, constraints: Collection[Constraint], row: int) -> str:
    """Name of the group of pins, or of the body, that prescribes a row of x."""
    holders = (constraint.holder(row) for constraint in constraints)
    return next(filter(None, holders), world.names[world.labels[row]])


def _objects(world: World, pair: ContactPair) -> tuple[str, str, str]:
    """Names of both objects of a contact pair, a cloth first, and of the third in a pinch (else empty)."""
    labels = sorted(int(world.labels[rows[0]]) for rows in (pair.first, pair.second))
    return world.names[labels[0]], world.names[labels[1]], "" if pair.pinch is None else world.names[pair.pinch]


def _names(world: World, constraints: Collection[Constraint], pair: ContactPair) -> tuple[str, str]:
    """Names of both simplices, the cloth's first."""
    sides = sorted((pair.first, pair.second), key=lambda rows: int(world.labels[rows[0]]))
    return simplex_name(world, constraints, sides[0]), simplex_name(world, constraints, sides[1])
