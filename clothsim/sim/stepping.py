"""One step of the integrator: solve; on failure the same state with half the dt; on success dt grows back."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from clothsim.energies.base import Constraint, Step
from clothsim.mesh.world import World
from clothsim.sim.motion import prescribed
from clothsim.sim.state import State
from clothsim.solve.newton import Newton, NewtonResult, NewtonSettings
from clothsim.solve.potential import Potential
from clothsim.solve.system import System

GROWTH = 1.05
MAX_HALVINGS = 10


@dataclass(frozen=True)
class Integrator:
    """Backward Euler on the incremental potential; quasi-static where the potential has no inertia.

    dt: the longest step [s]; ramp: the time over which loads grow from 0 to 1 [s], 0 where they act at once.
    """

    world: World
    potential: Potential
    constraints: Mapping[str, Constraint]
    system: System
    settings: NewtonSettings
    dt: float
    ramp: float


@dataclass(frozen=True)
class StepReport:
    """A step taken or given up: the state after it, its dt [s], the solve, the bound potential, failed tries.

    frame_done: whether it ended on a frame; minimum_gap [m]: the smallest distance below d_hat, else inf;
    fastest [m/s]: the largest speed of a cloth vertex.
    """

    state: State
    dt: float
    result: NewtonResult
    potential: Potential
    failures: tuple[str, ...]
    minimum_gap: float
    fastest: float
    frame_done: bool = False

    @property
    def converged(self) -> bool:
        """True where the step was taken."""
        return self.result.outcome.converged


def advance(integrator: Integrator, state: State, until: float) -> StepReport:
    """One step from `state`, no further than `until` [s].

    Steps share the way to `until` evenly, so that none is left over as a splinter. A failed solve is tried again from
    the same state with half the dt, down to the longest dt halved MAX_HALVINGS times: below that the run would creep
    towards what stops it without end. The last report is then of a step not taken.
    """
    with integrator.potential.ledger.phase("step control"):
        return _advance(integrator, state, until)


def _advance(integrator: Integrator, state: State, until: float) -> StepReport:
    left = until - state.time
    failures: list[str] = []
    dt = state.dt
    smallest = 0.999 * integrator.dt / 2**MAX_HALVINGS
    for _ in range(MAX_HALVINGS + 1):
        pieces = max(1, int(np.ceil(left / dt - 1e-9)))
        h = left / pieces
        end = until if pieces == 1 else state.time + h
        bound, result = _solve(integrator, state, h, end)
        if result.outcome.converged:
            after = _after(integrator, state, result, h, end, dt)
            return _report(integrator, after, h, result, bound, failures)
        failures.append(f"dt {h:.3g} s: {result.outcome.sentence}")
        dt = 0.5 * h
        if dt < smallest:
            break
    return _report(integrator, state, h, result, bound, failures)


def _solve(integrator: Integrator, state: State, h: float, end: float) -> tuple[Potential, NewtonResult]:
    load = min(1.0, end / integrator.ramp) if integrator.ramp else 1.0
    start = Step(state.time, h, state.positions, state.velocities, load, np.zeros_like(state.positions))
    bound = integrator.potential.begin(start)
    target = prescribed(integrator.world, integrator.constraints.values(), end)
    integrator.system.begin(bound.couplings(state.positions))
    result = Newton(bound, integrator.system, integrator.settings, h).minimise(state.positions, target)
    for _ in range(1, bound.passes):
        if not result.outcome.converged:
            break
        bound = bound.again(result.x)
        before = result.iterations
        result = Newton(bound, integrator.system, integrator.settings, h).minimise(result.x, target)
        result = replace(result, iterations=before + result.iterations)
    return bound, result


def _after(integrator: Integrator, state: State, result: NewtonResult, h: float, end: float, dt: float) -> State:
    """The next state: v = (x - x_n) / h (backward Euler)."""
    velocities = (result.x - state.positions) / h
    grown = min(integrator.dt, dt * GROWTH)
    return replace(state, time=end, dt=grown, step=state.step + 1, positions=result.x, velocities=velocities)


def _report(
    integrator: Integrator, state: State, h: float, result: NewtonResult, bound: Potential, failures: list[str]
) -> StepReport:
    velocities = state.velocities[: integrator.world.n_cloth]
    fastest = float(np.linalg.norm(velocities, axis=1).max())
    return StepReport(state, h, result, bound, tuple(failures), bound.minimum_gap(state.positions), fastest)
