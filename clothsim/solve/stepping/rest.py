"""State of rest: slow for several steps, near an equilibrium, and with nothing left that will change.

Speeds alone mislead: where a cloth turns back all of them vanish together, and one that creeps is slow for long. The
distance from equilibrium tells both from rest; it takes a factorisation, so it is looked at only where the cloth is
slow. A slow cloth is looked at where a frame ends, on which a run may end.
"""

from dataclasses import replace

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.physics.energies.base import Energy
from clothsim.solve.newton.potential import Potential
from clothsim.solve.stepping.branch_switching import (
    displaced,
    out_of_plane,
    stabilised,
    standing,
    static_model,
    unstable_side,
)
from clothsim.solve.stepping.prescribed import prescribed
from clothsim.solve.stepping.state import Rest, State
from clothsim.solve.stepping.stepping import Integrator, StepReport

SLOW_STEPS = 10
"""Consecutive steps without a vertex faster than `Integrator.rest_speed` before the distance is looked at."""
REST_TIME = 1.0
"""The distance from equilibrium at rest is at most `Integrator.rest_speed` times this [s]."""
LATER_TIMES = 32
"""Later times at which loads and prescribed positions are compared with those of now."""
GOLDEN = 0.5 * (5**0.5 - 1)
"""Spacing of the later times as a fraction of their range, modulo 1: no period of a rotation or a gust fits it."""
ROUNDING = 1e-9
"""Relative change of a load or a position below which it is none."""


def with_rest(integrator: Integrator, before: State, report: StepReport, until: float) -> StepReport:
    """Return the report of a step with the `rest` of its state, which is displaced where it was found unstable.

    Parameters
    ----------
    integrator : Integrator
        Took the step.
    before : State
        Start of the step.
    report : StepReport
        The step.
    until : float
        End of the loads that matter [s].
    """
    if not report.converged:
        return report
    static = "inertia" not in integrator.potential.energies
    with integrator.potential.timers.phase("stability"):
        report = stabilised(integrator, before, report) if static else out_of_plane(integrator, report)
    slow = report.state.slow_steps + 1 if report.fastest < integrator.rest_speed else 0
    rest = report.state.rest if slow else Rest.MOVING
    if report.frame_done and rest is not Rest.REACHED and (static or slow >= SLOW_STEPS):
        with integrator.potential.timers.phase("stability"):
            report, rest = _looked_at(integrator, report, until, static)
        slow = slow if rest is Rest.REACHED else 0
    return replace(report, state=replace(report.state, slow_steps=slow, rest=rest))


def _looked_at(integrator: Integrator, report: StepReport, until: float, static: bool) -> tuple[StepReport, Rest]:
    """The report of a step whose end is slow, displaced where that is unstable, and its state of rest."""
    changes = _changes(integrator, report, until)
    if static and changes:
        return report, Rest.CHANGING
    model = static_model(integrator, report)
    distance = float(np.linalg.norm(model.displacement(), axis=1).max(initial=0.0))
    near = distance < REST_TIME * integrator.rest_speed
    side = unstable_side(integrator, model) if near else None
    if side is not None and not static:
        report = displaced(report, side)
    if side is not None and integrator.leaves_unstable:
        return report, Rest.UNSTABLE
    if changes:
        return report, Rest.CHANGING
    return report, Rest.REACHED if near else Rest.DISTANT


def _changes(integrator: Integrator, report: StepReport, until: float) -> bool:
    """True where a load or a prescribed position changes between the state and `until` [s]."""
    state, held = report.state, integrator.constraints.values()
    if integrator.load(state.time) < 1.0:
        return True
    span = max(until - state.time, REST_TIME)
    later = [span, *(span * (k * GOLDEN % 1.0) for k in range(1, LATER_TIMES))]
    still = all([*(body.motion.still for body in integrator.world.bodies), *(one.still for one in held)])
    if not still:
        now = prescribed(integrator.world, held, state.time).positions
        if any(_differ(prescribed(integrator.world, held, state.time + t).positions, now) for t in later):
            return True
    return any(_varies(integrator, state, energy, later) for energy in _timed(report.potential))


def _timed(bound: Potential) -> list[Energy]:
    """The energies that may depend on time: those that are bound to a step, but for those bound last (contact)."""
    return [e for e in bound.energies.values() if type(e).begin is not Energy.begin and not e.begins_last]


def _varies(integrator: Integrator, state: State, energy: Energy, later: list[float]) -> bool:
    """True where the force of an energy on the cloth without velocities varies over time."""

    def force(t: float) -> Floats:
        return energy.begin(standing(integrator, state, t)).gradient(state.positions)

    now = force(0.0)
    return any(_differ(force(t), now) for t in later)


def _differ(a: Floats, b: Floats) -> bool:
    return bool(np.abs(a - b).max(initial=0.0) > ROUNDING * np.abs(b).max(initial=0.0))
