"""Backward pass over the steps of a run: the adjoint of each step, and the gradient by states and prescribed positions.

Step k minimises E, so that G(x_k; past, lag, p) = dE/dx = 0 on the free rows, and v_k = (x_k - past.x)/past.dt. With
(lx, lv) = (dL/dx_k, dL/dv_k) over all rows and H the exact Hessian at x_k (docs/theory.md#gradients):

    w = lx + lv/past.dt,    H a = w on the free rows, a = 0 elsewhere
    d(past.x) = -lv/past.dt - d(a.G)/d(past.x),    d(past.v) = -d(a.G)/d(past.v),    d(x_(k-1)) = -d(a.G)/d(x_(k-1))
    d(prescribed rows of x_k) = w - H a,           dL/dp = -a . dG/dp

Rows that a body carries through a pinch (`HeldChoices`) are prescribed by the bodies and by the start of the step, and
what comes to them goes on there. Energies are those of the step, without its excluded contact.

The contact pairs of recorded states are remembered: the pass searches for none.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import ClothsimError
from clothsim.gradients.differentiable_session import RecordedStep, bound_to, free_rows
from clothsim.gradients.exact_system import DESCENT, exact_system, solved
from clothsim.physics.contact.barrier import Barrier
from clothsim.physics.contact.candidates import ActivePairs, Candidates
from clothsim.physics.energies.base import Energy, Past, Step
from clothsim.physics.energies.hessians import ByElement, explicit
from clothsim.physics.energies.protocols import HistorySensitivity, PastSensitivity, StartDerivatives, is_idle
from clothsim.solve.linear.linear_system import System
from clothsim.solve.newton.potential import Potential
from clothsim.solve.pinch.flypaper import MEMORY, HeldChoices, flypapered_in, with_bodies
from clothsim.solve.stepping.stepping import Integrator


class RememberedPairs(Candidates):
    """Candidates that know the active pairs of the last two states, the ends of a step."""

    def __init__(self, like: Candidates) -> None:
        super().__init__(like.surface, like.activation_distance, like.skin, like.offset)

    def remember(self, x: Floats, keys: Ints) -> None:
        """Take the pairs with given keys for the active set at x."""
        self._active.at(self.read(x), lambda x: ActivePairs(self.search.of_keys(keys)))


def with_remembered_pairs(integrator: Integrator) -> Integrator:
    """Return an integrator whose barriers can `remember` the pairs of recorded steps."""
    potential = integrator.potential
    energies = {
        name: replace(each, candidates=RememberedPairs(each.candidates)) if isinstance(each, Barrier) else each
        for name, each in potential.energies.items()
    }
    return replace(integrator, potential=Potential(energies, potential.timers))


def remember(integrator: Integrator, record: RecordedStep) -> None:
    """Tell the barriers the pairs at the solution of a step; where vertices were carried others may act next to it."""
    if record.carried is not None:
        return
    for name, each in integrator.potential.energies.items():
        if isinstance(each, Barrier) and isinstance(each.candidates, RememberedPairs) and name in record.pairs:
            each.candidates.remember(record.solution, record.pairs[name])


# Derivative of a force by the start of its step, by central differences: the default of every energy.
#
# An energy binds itself to the start of a step (`Energy.begin`): positions, velocities, and both of the difference
# formula. The derivative of a.g(x; start) by each entry takes two bindings; rows whose stencils do not meet are varied
# together. That is checked against a difference along a random direction, and where an energy reaches further than its
# stencils (the mean of a border, for the pressure of an open cloth), each row is varied alone.

SLOTS = ("positions", "velocities", "past_positions", "past_velocities")
STEP = 1e-6
"""Displacement of an entry as a fraction of the largest coordinate or speed."""
ROUNDING = 1e-9
"""Part of an adjoint below which another one is none."""
AGREEMENT = 1e-5
"""Relative difference to the derivative along a random direction above which rows are varied one by one."""

Bind = Callable[[Step], Energy]


def past_by_differences(bind: Bind, step: Step, x: Floats, adjoint: Floats) -> StartDerivatives:
    """Return d(adjoint . gradient(x)) by the start of a step.

    Parameters
    ----------
    bind : callable
        Binds the energy to a step.
    step : Step
        The step that is varied.
    x, adjoint : (N, 3) array
        Positions at the end of the step [m], and the adjoint of the forces [m].

    Returns
    -------
    StartDerivatives
        A part that the energy does not depend on is None.
    """
    bound = bind(step)
    reference, groups = bound.gradient(x), None
    parts: dict[str, Floats] = {}
    for slot in SLOTS:
        values = _values(step, slot)
        size = STEP * max(float(np.abs(values).max(initial=0.0)), 1e-3)
        direction = np.random.default_rng(1).standard_normal(values.shape)

        def force(values: Floats, slot: str = slot) -> Floats:
            return bind(_replace_slot(step, slot, values)).gradient(x)

        if np.array_equal(force(values + size * direction), reference):
            continue
        groups = _independent_rows(bound, x) if groups is None else groups
        wanted = float(np.vdot(adjoint, force(values + size * direction) - force(values - size * direction)))
        found = _grouped(force, values, size, adjoint, *groups)
        scale = float(np.linalg.norm(found)) * float(np.linalg.norm(direction))
        if abs(np.vdot(found, direction) - wanted / (2 * size)) > AGREEMENT * scale + 1e-300:
            found = _grouped(force, values, size, adjoint, *_single_rows(len(x)))
        parts[slot] = found
    return StartDerivatives(**parts)


def _grouped(
    force: Callable[[Floats], Floats], values: Floats, size: float, adjoint: Floats, groups: list[Ints], near: Floats
) -> Floats:
    """Derivatives by each entry of `values`, those of a group at a time; near (N, N): rows that act on one another."""
    out = np.zeros_like(values)
    for rows in groups:
        for k in range(3):
            offset = np.zeros_like(values)
            offset[rows, k] = size
            change = (adjoint * (force(values + offset) - force(values - offset))).sum(axis=1) / (2 * size)
            out[rows, k] = near[rows] @ change
    return out


def _independent_rows(bound: Energy, x: Floats) -> tuple[list[Ints], Floats]:
    """Groups of rows whose stencils have no row in common, and the stencils as a matrix (N, N) of zeros and ones."""
    near = np.eye(len(x))
    for hessian in explicit([bound.hessian(x, False)]):
        if not isinstance(hessian, ByElement):
            return _single_rows(len(x))
        for a in range(hessian.elements.shape[1]):
            for b in range(hessian.elements.shape[1]):
                near[hessian.elements[:, a], hessian.elements[:, b]] = 1.0
    meets = (near @ near) > 0
    colours = np.full(len(x), -1)
    for row in range(len(x)):
        taken = set(colours[meets[row]].tolist())
        colours[row] = next(c for c in range(len(x) + 1) if c not in taken)
    return [np.flatnonzero(colours == c) for c in range(int(colours.max(initial=-1)) + 1)], near


def _single_rows(n: int) -> tuple[list[Ints], Floats]:
    return [np.array([row]) for row in range(n)], np.ones((n, n))


def _values(step: Step, slot: str) -> Floats:
    past, name = step.past, slot.removeprefix("past_")
    return np.asarray(getattr(step if name == slot else past, name), np.float64)


def _replace_slot(step: Step, slot: str, values: Floats) -> Step:
    past = step.past
    held = replace(step, multistep_past=Past(past.positions, past.velocities, past.dt))
    name = slot.removeprefix("past_")
    changed: dict[str, Any] = {name: values}
    return replace(held, **changed) if name == slot else replace(held, multistep_past=replace(past, **changed))


@dataclass(frozen=True, eq=False)
class StateAdjoint:
    """dL by a state between two steps.

    Parameters
    ----------
    positions, velocities, before_positions, before_velocities : (N, 3) float64
        By x and v, and by those one step earlier (`State.previous`).
    memory : mapping
        By what energies carry over (`State.memory`), by effect; 0 where it is left out.
    """

    positions: Floats
    velocities: Floats
    before_positions: Floats
    before_velocities: Floats
    memory: Mapping[str, Floats]

    def plus(self, positions: Floats | None, velocities: Floats | None) -> "StateAdjoint":
        """Return the adjoint with more by x and v (N, 3); None for 0."""
        x = self.positions if positions is None else self.positions + positions
        v = self.velocities if velocities is None else self.velocities + velocities
        return replace(self, positions=x, velocities=v)


def no_adjoint(rows: int) -> StateAdjoint:
    """Return the adjoint of a loss that does not depend on the state of so many rows."""
    zero = np.zeros((rows, 3))
    return StateAdjoint(zero, zero, zero, zero, {})


@dataclass(frozen=True, eq=False)
class StepBack:
    """Result of a step backwards.

    Parameters
    ----------
    state : StateAdjoint
        dL by the state at the start of the step.
    forces, prescribed : (N, 3) float64
        a, and dL by the prescribed rows, as of `Adjoints`.
    newton, doubt : float
        As of `Adjoints`.
    memory_adjoints : mapping
        dL by what energies carry over from the step, by effect.
    """

    state: StateAdjoint
    forces: Floats
    prescribed: Floats
    newton: float
    doubt: float
    memory_adjoints: Mapping[str, Floats]


@dataclass(frozen=True)
class Adjoints:
    """Result of a backward pass.

    Parameters
    ----------
    forces : (K, n, 3) float64
        a of each step at the cloth vertices, the derivative of the loss by a force in that step [loss / N].
    prescribed : (K, N, 3) float64
        dL by the rows that the scene prescribes, at the end of each step, 0 in the others [loss / m]. nan (not known)
        of bodies that deform in a step that was shortened, where what they carry depends on its first length.
    start, velocities : (N, 3) float64
        dL by the positions and velocities at the start of the run.
    newton : (K,) float64
        -a . G of each step: what the loss would still change by if its solve were exact.
    doubt : (K,) float64
        |a . G| one exact Newton step further, what the first order leaves out; inf where contact blocks that step.
    memory_adjoints : tuple of mappings
        dL by what energies carry over from each step (`StateAdjoint.memory` of its end), by effect.
    """

    forces: Floats
    prescribed: Floats
    start: Floats
    velocities: Floats
    newton: Floats
    doubt: Floats
    memory_adjoints: tuple[Mapping[str, Floats], ...]

    def known(self, derivative: Floats) -> Floats:
        """Return a derivative. ClothsimError where it depends on adjoints of bodies that are not known."""
        if np.isnan(derivative).any() and np.isnan(self.prescribed).any():
            raise ClothsimError(
                "A step in a pinch was shortened, and how the body at the end of its first try acts on what it carries "
                "is not known: there is no derivative with respect to the body.",
                "Give a shorter solver.dt.",
            )
        return derivative


def backward_pass(
    integrator: Integrator,
    steps: Sequence[RecordedStep],
    by_positions: Mapping[int, Floats],
    by_velocities: Mapping[int, Floats] | None = None,
    system: System | None = None,
) -> Adjoints:
    """Go backwards over recorded steps.

    Parameters
    ----------
    integrator : Integrator
        That of the run, with contact stiffnesses held.
    steps : sequence of RecordedStep
        All steps of the run in their order.
    by_positions, by_velocities : mapping of int to (N, 3) arrays
        dL by the positions and velocities after so many steps, 0 at the start.
    system : System, optional
        To factor with; None: the integrator's.

    Raises
    ------
    NoMinimumError
        Where a step did not end at a minimum.
    """
    integrator = with_remembered_pairs(integrator)
    n, rows = integrator.world.n_cloth, integrator.world.n_vertices
    forces, held = np.zeros((len(steps), n, 3)), np.zeros((len(steps), rows, 3))
    newton, doubt, memory_adjoints = np.zeros(len(steps)), np.zeros(len(steps)), list[Mapping[str, Floats]]()
    by_velocities = by_velocities or {}
    state = no_adjoint(rows).plus(by_positions.get(len(steps)), by_velocities.get(len(steps)))
    for k in range(len(steps) - 1, -1, -1):
        for near in steps[max(k - 1, 0) : k + 1]:
            remember(integrator, near)
        back = step_back(integrator, steps[k], state, f"after step {k + 1}", system)
        memory_adjoints.append(back.memory_adjoints)
        state = back.state.plus(by_positions.get(k), by_velocities.get(k))
        held[k], forces[k], newton[k], doubt[k] = back.prescribed, back.forces[:n], back.newton, back.doubt
    return Adjoints(forces, held, state.positions, state.velocities, newton, doubt, tuple(reversed(memory_adjoints)))


def step_back(
    integrator: Integrator, record: RecordedStep, by_end: StateAdjoint, where: str, system: System | None = None
) -> StepBack:
    """Go backwards over one step.

    Parameters
    ----------
    integrator, system
        As of `backward_pass`.
    record : RecordedStep
        The step.
    by_end : StateAdjoint
        dL by the state at its end.
    where : str
        Names that state in an error.

    Raises
    ------
    NoMinimumError
        Where the step did not end at a minimum.
    """
    integrator = record.of_step(integrator)
    step, bound = bound_to(integrator, record)
    past, free = step.past, free_rows(integrator, record)
    by_velocity = velocity_part(by_end.velocities, past.dt)
    w = by_end.positions + by_velocity
    exact = exact_system(bound, record.solution, system or integrator.system, np.flatnonzero(~free))
    a = solved(exact, w, where)
    held = np.where(free[:, None], 0.0, w - exact.prescribed_rows_times(a))
    left = bound.gradient(record.solution)
    doubt = _beyond(bound, record.solution, exact.solve(-left), a)
    seen, memory = seen_past(integrator, bound, step, record.solution, a, by_end.memory)
    seen["past_positions"] += by_velocity
    new, old = past_weights(record, integrator)
    by_memories = {name: -part for name, part in memory.items()}
    carried = carried_back(record, held, by_end.memory)
    state = StateAdjoint(
        by_end.before_positions - seen["positions"] - new * seen["past_positions"] + carried.positions,
        by_end.before_velocities - seen["velocities"] - new * seen["past_velocities"],
        old * seen["past_positions"],
        old * seen["past_velocities"],
        {**by_memories, **carried.memory},
    )
    memory_adjoints = by_end.memory if record.carried is None else {**by_end.memory, LIMIT: carried.limit}
    return StepBack(state, a, carried.prescribed, -float(np.vdot(a, left)), doubt, memory_adjoints)


LIMIT = "contact.pinch.limit"
"""Name of the gap below which a pinch closes among the adjoints of memories."""


@dataclass(frozen=True)
class CarriedAdjoint:
    """dL by what carried vertices follow in a step.

    Parameters
    ----------
    prescribed : (N, 3) array
        By the rows that the scene prescribes: of the carried ones it has gone to bodies and to the start.
    positions : (N, 3) array
        By the start of the step.
    memory : mapping
        By the carried vertices of the step before.
    limit : () array
        By the gap below which a pinch closes.
    """

    prescribed: Floats
    positions: Floats
    memory: Mapping[str, Floats]
    limit: Floats


def carried_back(record: RecordedStep, held: Floats, memory: Mapping[str, Floats]) -> CarriedAdjoint:
    """Pass dL by the prescribed rows (N, 3) and by memories of the end on to what carried vertices follow."""
    carried, x = record.carried, record.start.positions
    if carried is None:
        return CarriedAdjoint(held, np.zeros_like(x), {}, np.zeros(()))
    now, known, end = carried.flypapered, flypapered_in(record.start.memory), record.solution
    choices, ahead = HeldChoices.of(record.start, carried), with_bodies(carried.world, x, carried.ahead)
    by_memory = memory.get(MEMORY, np.zeros((len(now), 16)))
    by = by_memory[:, 4:7], by_memory[:, 7:10], held[now.vertices]
    inputs = choices.inputs(x, ahead, end, known, carried.limit)
    by_start, by_ahead, by_end, by_weights, by_offsets, by_limit = choices.adjoint(inputs, by)
    at_start, prescribed = np.zeros_like(x), held.copy()
    prescribed[now.vertices] = 0.0
    np.add.at(at_start, choices.rows, by_start)
    np.add.at(prescribed, now.triangles, by_end)
    if abs(carried.ahead - record.end.time) <= ROUNDING * record.dt:
        np.add.at(prescribed, choices.rows[:, 1:], by_ahead)
    else:
        least = ROUNDING * max(np.abs(by_end).max(), np.abs(by_start).max())
        prescribed[choices.rows[:, 1:][np.abs(by_ahead).max(axis=2) > least]] = np.nan
    by_known, own = np.zeros((len(known), 16)), choices.before >= 0
    by_known[choices.before[own], 4:7], by_known[choices.before[own], 7:10] = by_weights[own], by_offsets[own]
    return CarriedAdjoint(prescribed, at_start, {MEMORY: by_known} if len(known) else {}, by_limit.sum())


def _beyond(bound: Potential, x: Floats, dx: Floats, a: Floats) -> float:
    """|a . G(x + dx)| after a Newton step dx; 0 for one of round-off, inf for one that contact blocks."""
    if np.abs(dx).max() <= DESCENT.tolerance:
        return 0.0
    return abs(float(np.vdot(a, bound.gradient(x + dx)))) if bound.step_limit(x, dx) == 1.0 else math.inf


def velocity_part(by_velocities: Floats, dt: float) -> Floats:
    """Return dL/dx by way of v = (x - past.x)/dt; by past.x it is the negative."""
    return by_velocities / dt


def seen_past(
    integrator: Integrator,
    bound: Potential,
    step: Step,
    x: Floats,
    adjoint: Floats,
    memory_adjoints: Mapping[str, Floats],
) -> tuple[dict[str, Floats], dict[str, Floats]]:
    """Return the sum over the energies of `StartDerivatives`, by the names of its parts, (N, 3) each; and by memories.

    memory_adjoints: dL by what energies carry over from this step; without one it is 0.
    """
    total, memory = {name: np.zeros_like(x) for name in SLOTS}, dict[str, Floats]()
    for name, energy in bound.energies.items():
        own = integrator.potential.energies[name]
        if isinstance(energy, HistorySensitivity):
            memory_adjoint = memory_adjoints.get(name, np.zeros_like(np.asarray(energy.carry_over)))
            part = energy.history_sensitivity(step, x, adjoint, memory_adjoint)
            if part.memory is not None:
                memory[name] = part.memory
        elif is_idle(energy):
            continue
        elif isinstance(energy, PastSensitivity):
            part = energy.past_sensitivity(step, x, adjoint)
        elif type(own).begin is Energy.begin or own.begin(step) is own:  # the same in each step
            continue
        else:
            part = past_by_differences(own.begin, step, x, adjoint)
        for slot in total:
            derivative = getattr(part, slot)
            if derivative is not None:
                total[slot] += derivative
    return total, memory


def past_weights(record: RecordedStep, integrator: Integrator) -> tuple[float, float]:
    """Return the weights of x_(k-1) and -x_(k-2) in the past of a step: 1 and 0, or those of BDF2."""
    formula = record.formula(integrator)
    if formula.order == 1:
        return 1.0, 0.0
    r = formula.ratio
    return (1 + r) ** 2 / (1 + 2 * r), r**2 / (1 + 2 * r)
