"""Time step with retries: a failed solve is repeated from the same state with half the dt; after success dt grows back.

With a requested error, steps whose local error is too large are repeated too, and the next dt is chosen from it.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from clothsim.base.parallel import threads
from clothsim.mesh.world import World
from clothsim.physics.energies.base import CONTACT_TIME_SCALE, Constraint, Prescribed, Step
from clothsim.solve.linear.direct_solver import one_blas_thread
from clothsim.solve.linear.linear_system import System
from clothsim.solve.newton.convergence import LEAST_SPEED, ErrorBalance, MotionStop, StaticStop
from clothsim.solve.newton.newton import TOLERANCE_ALONE, Newton, NewtonResult, NewtonSettings
from clothsim.solve.newton.outcome import Ending, Observer, unobserved
from clothsim.solve.newton.potential import Potential
from clothsim.solve.stepping.failure import Failure, failure_of, try_sentence
from clothsim.solve.stepping.integrators import BACKWARD_EULER, BDF2, Formula, formula_of, predicted_start, prescribed
from clothsim.solve.stepping.local_error import ErrorControl, StepError, error_balance, motion_stop, step_error
from clothsim.solve.stepping.mechanical_energy import gains_energy
from clothsim.solve.stepping.state import Previous, State, Switch

GROWTH = 1.25
"""Growth of dt over the step before, after one that needed no second try: ten halvings are made good in 31 steps."""
MAX_HALVINGS = 10
MOST_TRIES = 100
MOST_SUNK = 2
"""Solves of a step that are repeated with a stiffer contact, where the cloth sank into its barrier."""
STATIC_ITERATIONS = 10
"""Bound on the iterations of the first try of a quasi-static step, over `max_iterations`.

A shorter step has a smaller load, and where little but the load resists (a sheet hinged at an edge swings down at any
load) that needs more iterations, as its power -1/4: 77, 128, 219 at 10, 1, .1 % of the weight.
"""
MOST_BLOCKED = 4
SAME_POSITION = 0.01
"""A prescribed motion is infeasible where MOST_BLOCKED tries end at the same point of it, to this fraction of a try.

The tries have shorter and shorter dt, in one step or in several. Contact forces grow without bound as the gap closes:
an obstacle that did not yield in four steps of any length will not yield in a fifth.
"""

PINCH_REMEDY = 'Where parts of a body close on the cloth, [contact] pinch = "carry" lets one of them carry it.'

Refine = Callable[[Potential, NewtonResult, Prescribed], NewtonResult]
"""Callback after a converged solve, with the bound potential, the result and the prescribed positions."""

Watch = Callable[[int, float, Potential], Observer]
"""Callback at each solve of a step, with its number from 1, dt [s] and the bound potential; returns an Observer."""


def unwatched(step: int, dt: float, potential: Potential) -> Observer:
    """Return the observer that does nothing."""
    return unobserved


def unrefined(potential: Potential, result: NewtonResult, target: Prescribed) -> NewtonResult:
    """Return the result as it is."""
    return result


@dataclass(frozen=True)
class Integrator:
    """Steps of the incremental potential; quasi-static where the potential has no inertia.

    Parameters
    ----------
    world : World
        Meshes.
    potential : Potential
        Sum of energies.
    constraints : mapping
        Constraints by effect name.
    system : System
        Newton matrix and its solver.
    settings : NewtonSettings
        Tolerance and bounds.
    dt : float
        Longest step [s].
    ramp : float
        Time over which loads grow from 0 to 1 [s]; 0: at once.
    watch : callable
        Observer of each solve.
    formula : str
        "backward_euler" or "bdf2".
    control : ErrorControl or None
        Step size control; None: dt is fixed.
    rest_speed : float
        Speed below which a vertex may count as at rest [m/s].
    leaves_unstable : bool
        True where unstable equilibria are left (`time_loop`).
    perturbation_seed : int
        Chooses the side.
    flypapers : bool
        True where cloth in a pinch of bodies is flypapered (`solve.pinch`).
    refine : callable
        Refinement of each converged solve (differentiable runs).
    contact_time : float
        Shortest time in which contact stops a motion [s] (`energies.base.contact_time`).
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
    rest_speed: float = 1e-3
    leaves_unstable: bool = True
    perturbation_seed: int = 0
    flypapers: bool = False
    refine: Refine = unrefined
    contact_time: float = CONTACT_TIME_SCALE

    def load(self, time: float) -> float:
        """Return the fraction of the loads that acts at `time` [s]."""
        return min(1.0, time / self.ramp) if self.ramp else 1.0

    def shortest(self, dt: float) -> float:
        """Return the length below which a step that was first tried with dt is given up [s]."""
        if self.control is None:
            return 0.999 * self.dt / 2**MAX_HALVINGS
        return 0.999 * max(dt / 2**MAX_HALVINGS, self.control.shortest / 16)


@dataclass(frozen=True)
class StepReport:
    """Result of a step, taken or given up.

    Parameters
    ----------
    state : State
        State after the step.
    dt : float
        Its length [s].
    result : NewtonResult
        Its last solve.
    potential : Potential
        Potential bound to that solve.
    failures : tuple of str
        Messages of the failed tries.
    minimum_gap : float
        Smallest distance below d_hat [m], else inf.
    fastest : float
        Largest speed of a cloth vertex or of a coordinate of a rigid body [m/s].
    frame_done : bool
        True where it ended on a frame.
    failure : Failure or None
        Cause of a step that was given up.
    error : StepError or None
        Its local error; None without inertia.
    rejected : int
        Tries whose local error was too large.
    at_floor : bool
        True where the error was too large and the step had the shortest length.
    switches : tuple of Switch
        Unstable equilibria at its end.
    restarted : bool
        True where BDF2 would have gained energy, and backward Euler took the step (`mechanical_energy`).
    constraints : mapping
        Constraints of the step, by effect name; those of the run, and flypapered vertices.
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
    switches: tuple[Switch, ...] = ()
    restarted: bool = False
    constraints: Mapping[str, Constraint] = field(default_factory=dict)

    @property
    def converged(self) -> bool:
        """True where the step was taken."""
        return self.result.outcome.converged


def advance(integrator: Integrator, state: State, until: float, retries: bool = True) -> StepReport:
    """Take one step from `state`, at most to `until` [s].

    Steps divide the time to `until` evenly, so that no tiny step remains. A failed solve is repeated from the same
    state with half the dt, down to the longest dt halved MAX_HALVINGS times: below that the run would approach its
    obstacle in endless small steps. A step that `control` rejects is repeated too. Without `retries` no solve is
    repeated with a shorter dt.

    Returns
    -------
    StepReport
        With `failure` where no try succeeded.
    """
    count, timers = integrator.system.threads, integrator.potential.timers
    with one_blas_thread(), threads(count), timers.phase("step control"):
        return _advance(integrator, state, until, retries)


def _advance(integrator: Integrator, state: State, until: float, retries: bool) -> StepReport:
    left = until - state.time
    failures: list[str] = []
    dts: list[float] = []
    tried, dt = state, state.dt
    smallest = integrator.shortest(dt) if retries else dt
    rejected, restarted = 0, False
    patient = integrator
    if "inertia" not in integrator.potential.energies:
        settings = integrator.settings
        more = replace(settings, max_iterations=STATIC_ITERATIONS * settings.max_iterations)
        patient = replace(integrator, settings=more)
    held = integrator.constraints.values()
    unbalanced: list[tuple[Potential, NewtonResult]] = []
    for attempt in range(1, MOST_TRIES + 1):
        pieces = max(1, int(np.ceil(left / dt - 1e-9)))
        h = left / pieces
        end = until if pieces == 1 else state.time + h
        target = prescribed(integrator.world, held, end)
        formula = formula_of(BACKWARD_EULER if restarted else integrator.formula, state, h)
        bound, result = _solve(patient if attempt == 1 else integrator, state, formula, h, end, target)
        if result.outcome.converged:
            after, error = _make_report(integrator, tried, formula, result, h, end, target)
            last = attempt == MOST_TRIES
            if not last and formula.order == 2 and gains_energy(integrator.world, bound, state, after, target):
                restarted = True
                continue
            shorter = _shorter(integrator, state, h, error)
            if shorter < h and not last:
                rejected, dt = rejected + 1, shorter
                continue
            grown = _next_dt(integrator, after, formula, h, dt, error, bool(failures or rejected))
            report = _report(integrator, replace(after, dt=grown, memory=bound.memory()), h, result, bound, failures)
            return replace(report, error=error, rejected=rejected, at_floor=shorter < np.inf, restarted=restarted)
        if result.outcome.ending is Ending.UNBALANCED:
            unbalanced.append((bound, result))
        failures.append(f"dt {h:.3g} s: {try_sentence(integrator.world, held, bound, result)}")
        dts.append(h)
        dt = 0.5 * h
        if result.outcome.ending is Ending.BLOCKED:
            tried = _blocked(tried, result, target, h)
        if dt < smallest or tried.blocked == MOST_BLOCKED:
            break
    infeasible = tried.blocked == MOST_BLOCKED
    cause = bound, result
    if unbalanced and result.outcome.ending in (Ending.LINE_SEARCH, Ending.ITERATION_LIMIT):
        cause = unbalanced[0]  # shorter steps end at round-off, which only hides why
    failure = failure_of(integrator.world, held, cause[0], tried, cause[1], target, dts, infeasible)
    moving = any(not body.motion.still for body in integrator.world.bodies)
    if result.outcome.ending is Ending.BLOCKED and moving and not integrator.flypapers:
        failure = replace(failure, remedy=f"{failure.remedy} {PINCH_REMEDY}")
    return replace(_report(integrator, state, h, result, bound, failures), failure=failure, rejected=rejected)


def _blocked(state: State, result: NewtonResult, target: Prescribed, h: float) -> State:
    """State with one more blocked try; all prescribed vertices cover the same fraction of their displacement."""
    rows = target.vertices
    left = np.abs(target.positions - result.x[rows]).max() / np.abs(target.positions - state.positions[rows]).max()
    at = state.time + (1 - left) * h
    if at < state.blocked_at - SAME_POSITION * h:
        return state  # cloth in between was not yet pushed out: says nothing of the obstacle further on
    again = at <= state.blocked_at + SAME_POSITION * h
    return replace(state, blocked_at=float(at), blocked=state.blocked + 1 if again else 1)


def step_of(integrator: Integrator, state: State, formula: Formula, h: float, end: float) -> Step:
    """Return the step of length h [s] from `state` to the time `end`, as the energies are bound to it."""
    zero = np.zeros_like(state.positions)
    start = Step(state.time, h, state.positions, state.velocities, integrator.load(end), zero, memory=state.memory)
    control = integrator.control
    least = integrator.contact_time
    scale = max(h, least) if control is None else control.contact_time_scale
    return replace(start, multistep_past=formula.past, contact_time_scale=scale, contact_time=least)


def _solve(
    integrator: Integrator, state: State, formula: Formula, h: float, end: float, target: Prescribed
) -> tuple[Potential, NewtonResult]:
    step = step_of(integrator, state, formula, h, end)
    bound, result = _minimise(integrator, state, formula, step, target, probed=True)
    for count in range(1, MOST_SUNK + 1):
        needed = bound.stiffnesses_needed(state.positions, result.x)
        if not needed:
            break
        softer, step = result, replace(step, least_stiffness={**step.least_stiffness, **needed})
        bound, result = _minimise(integrator, state, formula, step, target, probed=count < MOST_SUNK)
        result = _added(softer, result)
    for _ in range(1, bound.lag_iterations):
        if not result.outcome.converged:
            break
        before, bound = bound, bound.relag(result.x)
        if not (before.lagging or bound.lagging):
            break  # no lagged data before or after: the same problem
        result = _added(result, _newton(integrator, state, formula, h, bound, target).minimise(result.x, target))
    return bound, integrator.refine(bound, result, target) if result.outcome.converged else result


def _minimise(
    integrator: Integrator, state: State, formula: Formula, step: Step, target: Prescribed, probed: bool
) -> tuple[Potential, NewtonResult]:
    """First solve of a step: the potential bound to it, and its minimum; probed: it ends early where it sinks."""
    bound, h = integrator.potential.begin(step), step.dt
    integrator.system.begin(bound.couplings(state.positions, h * state.velocities))
    start = state.positions
    if integrator.world.rigid:
        start = predicted_start(integrator.world, integrator.system.dependent, bound, state, h)
    newton = _newton(integrator, state, formula, h, bound, target)
    if probed:
        newton = replace(newton, sinks=lambda x: bool(bound.stiffnesses_needed(state.positions, x)))
    return bound, newton.minimise(start, target)


def _added(before: NewtonResult, result: NewtonResult) -> NewtonResult:
    """A result with the iterations of the solves before it of the same step."""
    return replace(
        result,
        iterations=before.iterations + result.iterations,
        elimination_iterations=before.elimination_iterations + result.elimination_iterations,
    )


def _newton(
    integrator: Integrator, state: State, formula: Formula, h: float, bound: Potential, target: Prescribed
) -> Newton:
    observe = integrator.watch(state.step + 1, h, bound)
    settings, world = integrator.settings, integrator.world
    balance: ErrorBalance | MotionStop = TOLERANCE_ALONE
    dynamic = "inertia" in integrator.potential.energies
    if settings.error_fraction and not dynamic:
        balance = StaticStop(
            LEAST_SPEED * settings.error_fraction, world.n_cloth, start=state.positions, cell=world.cell
        )
        settings = replace(settings, tolerance=min(settings.tolerance, balance.floor / abs(h)))
    if settings.error_fraction and dynamic:
        n = world.n_unknowns
        held, part = target.vertices[target.vertices < n], settings.error_fraction
        if settings.converge:
            balance = error_balance(part, integrator.formula, formula, state, n, h, held)
        else:
            balance = motion_stop(part, settings.tolerance * h, integrator.formula, formula, world, state, h, held)
    least = float(integrator.world.inertial_masses.max()) * integrator.settings.tolerance / abs(h)
    return Newton(bound, integrator.system, settings, h, observe, balance, least)


def _make_report(
    integrator: Integrator,
    state: State,
    formula: Formula,
    result: NewtonResult,
    h: float,
    end: float,
    target: Prescribed,
) -> tuple[State, StepError | None]:
    """Next state and its local error. A block of the prescribed motion is cleared once it is passed."""
    previous = Previous(state.positions, state.velocities, h) if integrator.formula == BDF2 else None
    velocities, error, spent = formula.velocities(result.x), None, 0.0
    if "inertia" in integrator.potential.energies:
        n = integrator.world.n_unknowns
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
    """dt to try after a step of h [s] whose error is too large; h at the floor, inf where the error is admissible."""
    if integrator.control is None or error is None or not integrator.control.exceeds(state, h, error.rms):
        return np.inf
    return integrator.control.retry(state, h, error.rms) if h > (1 + 1e-6) * integrator.control.shortest else h


def _next_dt(
    integrator: Integrator, after: State, formula: Formula, h: float, dt: float, error: StepError | None, tried: bool
) -> float:
    """dt of the next step; tried: True where this one needed more than one try."""
    grown = min(integrator.dt, dt if tried else dt * GROWTH)
    if integrator.control is None or error is None:
        return grown
    if formula.order == 1 and integrator.formula == BDF2:
        return h  # a backward Euler error does not predict that of BDF2
    chosen = integrator.control.next_dt(after, h, error.rms, formula.order)
    return min(chosen, grown) if tried else chosen


def _report(
    integrator: Integrator, state: State, h: float, result: NewtonResult, bound: Potential, failures: list[str]
) -> StepReport:
    velocities = state.velocities[: integrator.world.n_unknowns]
    fastest = float(np.linalg.norm(velocities, axis=1).max())
    gap = bound.minimum_gap(state.positions)
    return StepReport(state, h, result, bound, tuple(failures), gap, fastest, constraints=integrator.constraints)
