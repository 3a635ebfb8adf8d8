"""One step of the integrator: solve; on failure the same state with half the dt; on success dt grows back.

Where an error is asked for, steps that add too much of it are tried again too, and the next dt is chosen from it.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from clothsim.energies.constraint import Constraint, Prescribed
from clothsim.energies.step import CONTACT_TIME_SCALE, Step
from clothsim.mesh.world import World
from clothsim.sim.failure import Failure, failure_of, told
from clothsim.sim.integrators import BACKWARD_EULER, BDF2, Formula, formula_of
from clothsim.sim.local_error import StepError, step_error
from clothsim.sim.prescribed import prescribed
from clothsim.sim.state import Previous, State
from clothsim.sim.step_size import ErrorControl
from clothsim.solve.linear_system import System
from clothsim.solve.newton import Newton, NewtonResult, NewtonSettings
from clothsim.solve.observer import Observer, unobserved
from clothsim.solve.outcome import Ending
from clothsim.solve.potential import Potential

GROWTH = 1.05
MAX_HALVINGS = 10
MOST_TRIES = 100
MOST_BLOCKED = 4
SAME_POSITION = 0.01
"""A scripted motion is infeasible when so many tries end at the same place of its way, to this share of a try's way.

The tries have shorter and shorter dt, in one step or in several. Contact pushes without bound as the gap closes: what
it did not move out of the way in four steps of any length, a fifth will not move either.
"""

Watch = Callable[[int, float, Potential], Observer]
"""Called at each solve of a step: its number from 1, dt [s] and the bound potential; returns who observes Newton."""


def unwatched(step: int, dt: float, potential: Potential) -> Observer:
    """Nobody observes."""
    return unobserved


@dataclass(frozen=True)
class Integrator:
    """Steps of the incremental potential; quasi-static where the potential has no inertia.

    dt: the longest step [s]; ramp: the time over which loads grow from 0 to 1 [s], 0 where they act at once; watch:
    who observes the solves; formula: "backward_euler" or "bdf2"; control: who chooses dt, None where it is fixed.
    """

    world: World
    potential: Potential
    constraints: Mapping[str, Constraint]
    system: System
    settings: NewtonSettings
    dt: float
    ramp: float
    watch: Watch = unwatched
    formula: str = BACKWARD_EULER
    control: ErrorControl | None = None

    def shortest(self, dt: float) -> float:
        """A step that was first tried with dt and does not succeed above this is given up [s]."""
        if self.control is None:
            return 0.999 * self.dt / 2**MAX_HALVINGS
        return 0.999 * max(dt / 2**MAX_HALVINGS, self.control.shortest / 16)


@dataclass(frozen=True)
class StepReport:
    """A step taken or given up: the state after it, its dt [s], the solve, the bound potential, failed tries.

    frame_done: whether it ended on a frame; minimum_gap [m]: the smallest distance below d_hat, else inf;
    fastest [m/s]: the largest speed of a cloth vertex; failure: why the step was given up, None where it was taken;
    error: what it added to the error, None where there is no inertia; rejected: tries that added too much of it;
    at_floor: whether it added too much, and was as short as a step may be.
    """

    state: State
    dt: float
    result: NewtonResult
    potential: Potential
    failures: tuple[str, ...]
    minimum_gap: float
    fastest: float
    frame_done: bool = False
    failure: Failure | None = None
    error: StepError | None = None
    rejected: int = 0
    at_floor: bool = False

    @property
    def converged(self) -> bool:
        """True where the step was taken."""
        return self.result.outcome.converged


def advance(integrator: Integrator, state: State, until: float) -> StepReport:
    """One step from `state`, no further than `until` [s].

    Steps share the way to `until` evenly, so that none is left over as a splinter. A failed solve is tried again from
    the same state with half the dt, down to the longest dt halved MAX_HALVINGS times: below that the run would creep
    towards what stops it without end. The last report is then of a step not taken. A step that `control` refuses is
    tried again too.
    """
    with integrator.potential.timers.phase("step control"):
        return _advance(integrator, state, until)


def _advance(integrator: Integrator, state: State, until: float) -> StepReport:
    left = until - state.time
    failures: list[str] = []
    dts: list[float] = []
    tried, dt = state, state.dt
    smallest, rejected = integrator.shortest(dt), 0
    held = integrator.constraints.values()
    for _ in range(MOST_TRIES):
        pieces = max(1, int(np.ceil(left / dt - 1e-9)))
        h = left / pieces
        end = until if pieces == 1 else state.time + h
        target = prescribed(integrator.world, held, end)
        formula = formula_of(integrator.formula, state, h)
        bound, result = _solve(integrator, state, formula, h, end, target)
        if result.outcome.converged:
            after, error = _after(integrator, tried, formula, result, h, end, target)
            shorter = _shorter(integrator, state, h, error)
            if shorter < h:
                rejected, dt = rejected + 1, shorter
                continue
            grown = _next_dt(integrator, after, formula, h, dt, error, bool(failures or rejected))
            report = _report(integrator, replace(after, dt=grown, memory=bound.memory()), h, result, bound, failures)
            return replace(report, error=error, rejected=rejected, at_floor=shorter < np.inf)
        failures.append(f"dt {h:.3g} s: {told(integrator.world, held, result.outcome)}")
        dts.append(h)
        dt = 0.5 * h
        if result.outcome.ending is Ending.BLOCKED:
            tried = _blocked(tried, result, target, h)
        if dt < smallest or tried.blocked == MOST_BLOCKED:
            break
    failure = failure_of(integrator.world, held, bound, tried, result, target, dts, tried.blocked == MOST_BLOCKED)
    return replace(_report(integrator, state, h, result, bound, failures), failure=failure, rejected=rejected)


def _blocked(state: State, result: NewtonResult, target: Prescribed, h: float) -> State:
    """The state with one more blocked try on its record; every carried vertex goes the same share of its way."""
    rows = target.vertices
    left = np.abs(target.positions - result.x[rows]).max() / np.abs(target.positions - state.positions[rows]).max()
    at = state.time + (1 - left) * h
    again = abs(at - state.blocked_at) <= SAME_POSITION * h
    return replace(state, blocked_at=float(at), blocked=state.blocked + 1 if again else 1)


def _solve(
    integrator: Integrator, state: State, formula: Formula, h: float, end: float, target: Prescribed
) -> tuple[Potential, NewtonResult]:
    load = min(1.0, end / integrator.ramp) if integrator.ramp else 1.0
    zero = np.zeros_like(state.positions)
    start = Step(state.time, h, state.positions, state.velocities, load, zero, memory=state.memory)
    control = integrator.control
    scale = max(h, CONTACT_TIME_SCALE) if control is None else control.contact_time_scale
    start = replace(start, weighed=formula.past, contact_time_scale=scale)
    bound = integrator.potential.begin(start)
    integrator.system.begin(bound.couplings(state.positions, h * state.velocities))
    result = _newton(integrator, state, h, bound).minimise(state.positions, target)
    for _ in range(1, bound.lag_iterations):
        if not result.outcome.converged:
            break
        before, bound = bound, bound.relag(result.x)
        if not (before.lagging or bound.lagging):
            break  # nothing was lagged, and nothing is: the same problem again
        iterations, elimination_iterations = result.iterations, result.elimination_iterations
        result = _newton(integrator, state, h, bound).minimise(result.x, target)
        result = replace(
            result,
            iterations=iterations + result.iterations,
            elimination_iterations=elimination_iterations + result.elimination_iterations,
        )
    return bound, result


def _newton(integrator: Integrator, state: State, h: float, bound: Potential) -> Newton:
    observe = integrator.watch(state.step + 1, h, bound)
    return Newton(bound, integrator.system, integrator.settings, h, observe)


def _after(
    integrator: Integrator,
    state: State,
    formula: Formula,
    result: NewtonResult,
    h: float,
    end: float,
    target: Prescribed,
) -> tuple[State, StepError | None]:
    """The next state and what the step added to its error. What blocked the script is forgotten once it is passed."""
    previous = Previous(state.positions, state.velocities, h) if integrator.formula == BDF2 else None
    velocities, error, spent = formula.velocities(result.x), None, 0.0
    if "inertia" in integrator.potential.energies:
        n = integrator.world.n_cloth
        held = target.vertices[target.vertices < n]
        error = step_error(integrator.formula, formula, state, velocities[:n], h, held)
        spent = error.rms
    if end > state.blocked_at + SAME_POSITION * h:
        state = replace(state, blocked_at=np.nan, blocked=0)
    after = replace(
        state,
        time=end,
        step=state.step + 1,
        positions=result.x,
        velocities=velocities,
        previous=previous,
        temporal_error=state.temporal_error + spent,
    )
    return after, error


def _shorter(integrator: Integrator, state: State, h: float, error: StepError | None) -> float:
    """The dt to try after a step of length h [s] that added too much error; h at the floor, inf where it did not."""
    if integrator.control is None or error is None or not integrator.control.exceeds(state, h, error.rms):
        return np.inf
    return integrator.control.retry(state, h, error.rms) if h > integrator.control.shortest else h


def _next_dt(
    integrator: Integrator, after: State, formula: Formula, h: float, dt: float, error: StepError | None, tried: bool
) -> float:
    """The dt of the next step; tried: whether this one needed more than one try."""
    grown = min(integrator.dt, dt * GROWTH)
    if integrator.control is None or error is None:
        return grown
    if formula.order == 1 and integrator.formula == BDF2:
        return h  # the error of this step tells nothing of the next one's
    chosen = integrator.control.next_dt(after, h, error.rms, formula.order)
    return min(chosen, grown) if tried else chosen


def _report(
    integrator: Integrator, state: State, h: float, result: NewtonResult, bound: Potential, failures: list[str]
) -> StepReport:
    velocities = state.velocities[: integrator.world.n_cloth]
    fastest = float(np.linalg.norm(velocities, axis=1).max())
    return StepReport(state, h, result, bound, tuple(failures), bound.minimum_gap(state.positions), fastest)
