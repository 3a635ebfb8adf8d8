"""Record, progress, checkpoint and summary of a run, made from its states."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from clothsim.base.process_memory import peak_memory
from clothsim.files.runs.checkpoint import Checkpoint
from clothsim.geometry.held_inside import held_inside
from clothsim.physics.energies.protocols import report_of
from clothsim.run.certificate.certificate import Certificate
from clothsim.run.certificate.condition_warnings import condition_warnings
from clothsim.run.certificate.intersection_check import IntersectionCheck
from clothsim.run.certificate.intersection_history import intersection_warnings
from clothsim.run.session import Session
from clothsim.solve.stepping.failure import Failure
from clothsim.solve.stepping.state import Previous, Rest, State
from clothsim.solve.stepping.stepping import StepReport
from clothsim.solve.timers import EffectCounters, Timers


@dataclass(frozen=True)
class Progress:
    """Progress after a step.

    Attributes
    ----------
    time, duration : float
        Simulated time and its end [s].
    step, newton_iterations : int
        Number of the step, and its iterations.
    minimum_gap : float
        Smallest distance in contact [m], inf where nothing is closer than d_hat.
    fastest : float
        Largest speed of a cloth vertex [m/s].
    verdict : {"moving", "settled", "stalled", "unstable"}
        Settled: no vertex is faster than ten times the tolerance; stalled: dt is below an eighth; unstable: the step
        ended in an unstable equilibrium.
    seconds : float
        Wall time since the start [s].
    stage : str
        Of a fit the stage that the run is.
    """

    time: float
    duration: float
    step: int
    newton_iterations: int
    minimum_gap: float
    fastest: float
    verdict: str
    seconds: float
    stage: str = ""


def entry_of(report: StepReport, certificate: Certificate) -> dict[str, Any]:
    """A line of the record."""
    return {
        "step": report.state.step,
        "time": report.state.time,
        "dt": report.dt,
        "newton_iterations": report.result.iterations,
        "regional_iterations": report.result.elimination_iterations,
        "speed": report.result.speed,
        "residual": report.result.residual,
        "relative_residual": report.result.relative_residual,
        "energy": certificate.energy,
        "stiffness_energy": certificate.stiffness.last,
        "minimum_gap": report.minimum_gap,
        "fastest": report.fastest,
        "failures": list(report.failures),
        "error": None if report.error is None else report.error.rms,
        "largest_error": None if report.error is None else report.error.largest,
        "rejected": report.rejected,
        "restarted": report.restarted,
        "unstable": [asdict(switch) for switch in report.switches],
        **({} if certificate.carried is None else {"carried": certificate.carried.now}),
    }


def progress_of(report: StepReport, session: Session, seconds: float) -> Progress:
    """The progress after a step; seconds: wall time since the run began [s]."""
    run, integrator = session.scene.run_settings, session.integrator
    verdict = "moving"
    if integrator.control is None and report.dt < integrator.dt / 8:
        verdict = "stalled"
    elif report.fastest < 10 * integrator.settings.tolerance:
        verdict = "settled"
    if report.switches:
        verdict = "unstable"
    return Progress(
        report.state.time,
        run.duration,
        report.state.step,
        report.result.iterations,
        report.minimum_gap,
        report.fastest,
        verdict,
        seconds,
    )


def summary_of(
    session: Session,
    state: State,
    certificate: Certificate,
    check: IntersectionCheck,
    failure: Failure | None,
    record: Sequence[Mapping[str, Any]],
    seconds: Mapping[str, float],
) -> dict[str, Any]:
    """The content of summary.json: the contract of the design, notes, warnings, the failure."""
    world, potential = session.built.world, session.integrator.potential
    energies = session.built.energies.items()
    unmet = certificate.estimate.unmet(certificate.asked)
    history = certificate.intersections
    inside = held_inside(world, state.positions) if "body_contact" in session.built.energies else []
    return {
        "status": "completed" if failure is None else "failed",
        "reason": _end_of(session, state) if failure is None else failure.reason,
        "failure": None if failure is None else failure.as_dict(),
        "stages": ["start", *("simulated" for _ in range(state.frame))],
        **seconds,
        "steps": state.step,
        "newton_iterations": sum(entry["newton_iterations"] for entry in record),
        "regional_iterations": sum(entry.get("regional_iterations", 0) for entry in record),
        "rejected_steps": sum(entry.get("rejected", 0) for entry in record),
        "restarted_steps": sum(entry.get("restarted", False) for entry in record),
        "linear_solves": potential.timers.linear_solves,
        "exact_check": asdict(certificate.checks),
        "peak_memory_bytes": peak_memory(),
        "vertices": world.n_cloth,
        "triangles": len(world.triangles),
        "solver": session.integrator.system.name,
        "notes": [*session.notes, *filter(None, [unmet])],
        "found": [f"{name}: {note}." for name, one in energies for note in report_of(one).final_notes(state.positions)],
        "effects": potential.effect_counters(),
        "off": session.built.off,
        "phases": potential.timers.phases,
        "warnings": [*intersection_warnings(history.as_dict(), check.on), *condition_warnings(certificate, inside)],
        "certificate": {
            **certificate.as_dict(check.coverage(history.complete), completed=failure is None),
            "held_inside": [asdict(each) for each in inside],
        },
    }


def _end_of(session: Session, state: State) -> str:
    """The sentence on the end of a completed run."""
    if session.scene.run_settings.until == "time":
        return f"{state.time:g} s were simulated."
    if state.at_rest:
        return f"The cloth is at rest after {state.time:g} s."
    return f"{state.time:g} s were simulated, the limit, and the cloth is not at rest: {state.rest.value}."


def checkpoint_of(session: Session, state: State, certificate: Certificate) -> Checkpoint:
    """The checkpoint of a run at `state`."""
    potential = session.integrator.potential
    counters = {
        "memory": dict(state.memory),
        "temporal_error": state.temporal_error,
        "slow_steps": state.slow_steps,
        "rest": state.rest.name,
        "certificate": certificate.as_json(),
        "effects": potential.effect_counters(),
        "phases": potential.timers.phases,
        "linear_solves": potential.timers.linear_solves,
    }
    before = state.previous
    return Checkpoint(
        time=state.time,
        dt=state.dt,
        frame=state.frame,
        step=state.step,
        positions=state.positions,
        velocities=state.velocities,
        scene_text=session.scene.to_text(names_of_functions=True),
        counters=counters,
        blocked_at=state.blocked_at,
        blocked=state.blocked,
        previous_positions=None if before is None else before.positions,
        previous_velocities=None if before is None else before.velocities,
        previous_dt=math.nan if before is None else before.dt,
    )


def state_of(saved: Checkpoint) -> State:
    """The state in a checkpoint of `checkpoint_of`."""
    x, v = saved.previous_positions, saved.previous_velocities
    return State(
        saved.time,
        saved.dt,
        saved.step,
        saved.frame,
        saved.positions,
        saved.velocities,
        saved.blocked_at,
        saved.blocked,
        memory=saved.counters.get("memory", {}),
        temporal_error=saved.counters.get("temporal_error", 0.0),
        slow_steps=saved.counters.get("slow_steps", 0),
        rest=Rest[saved.counters.get("rest", Rest.MOVING.name)],
        previous=None if x is None or v is None else Previous(x, v, saved.previous_dt),
    )


def restore(timers: Timers, counters: dict[str, Any]) -> None:
    """Set the counters to those of the stopped run."""
    for name, account in counters["effects"].items():
        timers.effects[name] = EffectCounters(**account)
    timers.phases.update(counters["phases"])
    timers.linear_solves = counters["linear_solves"]
