"""The main job: a scene becomes frames, a record, a summary and a checkpoint in a directory."""

import os
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from clothsim.errors import InputError
from clothsim.io.checkpoint import CHECKPOINT_NAME, Checkpoint, read_checkpoint, write_checkpoint
from clothsim.io.record import RECORD_NAME, SUMMARY_NAME, RecordWriter, read_record, write_summary
from clothsim.io.run import Run, open_run
from clothsim.io.surface import world_surfaces
from clothsim.io.trajectory import TRAJECTORY_NAME, TrajectoryWriter
from clothsim.mesh.motion import RigidMotion
from clothsim.mesh.world import World
from clothsim.scene.build import Built, build
from clothsim.scene.scene import Scene, scene_from_text
from clothsim.sim.certificate import Certificate, certificate_from, world_stretches
from clothsim.sim.judge import Judge, judge_of
from clothsim.sim.simulator import steps
from clothsim.sim.state import State, first_state
from clothsim.sim.stepping import Integrator, StepReport
from clothsim.solve.ledger import Account, Ledger
from clothsim.solve.linear import slowness
from clothsim.solve.memory import keep_freed_memory
from clothsim.solve.newton import NewtonSettings
from clothsim.solve.pattern import make_pattern
from clothsim.solve.potential import Potential
from clothsim.solve.system import System

LARGEST_TURN = 45.0
"""How far a body may turn in a step [degrees]: the straight way of a vertex then is 8 % of the radius off its arc."""


@dataclass(frozen=True)
class Progress:
    """What a caller may show after each step: simulated time and duration [s], the step, Newton iterations, gap [m].

    verdict: "moving", "settled" (no vertex faster than ten times the tolerance) or "stalled" (dt below an eighth).
    """

    time: float
    duration: float
    step: int
    newton_iterations: int
    minimum_gap: float
    fastest: float
    verdict: str
    seconds: float


@dataclass(frozen=True)
class Session:
    """A scene made ready to step; notes: what was chosen for the user and what the meshes had."""

    scene: Scene
    built: Built
    integrator: Integrator
    notes: tuple[str, ...]


Listener = Callable[[Progress], None]
"""Called after each step."""

Announcement = Callable[[Session], None]
"""Called once, when the scene is ready and before the first step."""


def simulate(
    scene: Scene,
    output: str | Path | None = None,
    progress: Listener | None = None,
    announce: Announcement | None = None,
) -> Run:
    """Simulate `scene`; leave trajectory, record, summary and checkpoint in `output` (None: a fresh temporary folder).

    A run that cannot go on ends with status "failed" and a sentence, and keeps its frames. InputError for bad input.
    """
    directory = Path(tempfile.mkdtemp(prefix="clothsim-") if output is None else output)
    started = perf_counter()
    session = prepare(scene, build(scene))
    _make_directory(directory)
    if announce is not None:
        announce(session)
    state = first_state(session.built.world, session.integrator.dt)
    return _run(session, state, Certificate(), directory, started, progress, resumed=False)


def resume(directory: str | Path, progress: Listener | None = None, announce: Announcement | None = None) -> Run:
    """Go on from the checkpoint in `directory`; with threads = 1 the frames equal an unstopped run's, bit for bit."""
    folder = Path(directory)
    started = perf_counter()
    saved = read_checkpoint(folder / CHECKPOINT_NAME)
    scene = scene_from_text(saved.scene_text)
    session = prepare(scene, build(scene))
    if len(saved.positions) != session.built.world.n_vertices:
        raise InputError(f"{folder} has another mesh than its checkpoint.", "Restore the mesh files of the scene.")
    state = State(saved.time, saved.dt, saved.step, saved.frame, saved.positions, saved.velocities)
    _restore(session.integrator.potential.ledger, saved.counters)
    if announce is not None:
        announce(session)
    certificate = certificate_from(saved.counters["certificate"])
    return _run(session, state, certificate, folder, started, progress, resumed=True)


def prepare(scene: Scene, built: Built) -> Session:
    """Pattern, solver and integrator of a built scene."""
    settings, run = scene.solver_settings(), scene.run_settings()
    _set_threads(settings.threads)
    keep_freed_memory()
    ledger = Ledger(effects={name: Account() for name in built.energies})
    potential = Potential(built.energies, ledger)
    start = built.world.start()
    hessians = [energy.hessian(start) for energy in built.energies.values()]
    pattern = make_pattern(built.world.n_cloth, built.world.triangles, hessians)
    system = System(pattern, settings.linear, settings.threads)
    newton = NewtonSettings(settings.tolerance, settings.max_iterations)
    ramp = 0.0 if "inertia" in built.energies else run.duration
    frame = 1 / run.frames_per_second
    dt = min(settings.dt, run.duration, frame)
    if "body_contact" in built.energies:
        _refuse_leaps(built.world, dt)
    integrator = Integrator(built.world, potential, built.constraints, system, newton, dt, ramp)
    shorter = f"Steps are {dt:g} s, not {settings.dt:g} s: each frame ends a step." if frame < settings.dt else ""
    slow = slowness(system.solver) if settings.linear == "auto" else ""
    notes = (*built.notes, *filter(None, [shorter, slow]))
    return Session(scene, built, integrator, notes)


def _run(
    session: Session,
    state: State,
    certificate: Certificate,
    directory: Path,
    started: float,
    progress: Listener | None,
    resumed: bool,
) -> Run:
    """Step to the end of the scene, writing as it goes; whatever stops it, the frames so far are on disk."""
    world, run = session.built.world, session.scene.run_settings()
    ledger = session.integrator.potential.ledger
    certificate = replace(certificate, moved_by_script=_scripted(session.built))
    reason, judge = "", _judge(session)
    if not resumed:
        _remove(directory / SUMMARY_NAME)
    with (
        TrajectoryWriter(
            directory / TRAJECTORY_NAME, world_surfaces(world), resume_at=state.frame + 1 if resumed else None
        ) as trajectory,
        RecordWriter(directory / RECORD_NAME, resume_at=state.step if resumed else None) as record,
    ):
        _remove(directory / SUMMARY_NAME)  # of a resumed run only now: one that cannot go on keeps what it has
        if not resumed:
            trajectory.append(0.0, state.positions + world.origin, world_stretches(world, state.positions))
            if judge.crossings(state.positions):
                certificate = replace(certificate, intersecting_frames=(0,))
            write_checkpoint(directory / CHECKPOINT_NAME, _checkpoint(session, state, certificate))
        warm = perf_counter() - started
        for report in steps(session.integrator, state, run.duration, run.frames_per_second):
            before, state = state, report.state
            if not report.converged:
                reason = f"At {state.time:.4g} s: {report.result.outcome.sentence} dt fell to {report.dt:.2g} s."
                if "inertia" not in session.built.energies:
                    reason += " Without effects.inertia every cloth must be held, by pins or by a body under it."
                break
            with ledger.phase("certificate"):
                certificate = certificate.after(world, report, before)
            with ledger.phase("output"):
                record.append(_entry(report, certificate))
            if progress is not None:
                progress(_progress(report, session, certificate, perf_counter() - started))
            if report.frame_done:
                with ledger.phase("output"):
                    trajectory.append(state.time, state.positions + world.origin, world_stretches(world, state.positions))
                with ledger.phase("certificate"):
                    found = judge.crossings(state.positions)
                    if found:
                        certificate = replace(
                            certificate, intersecting_frames=(*certificate.intersecting_frames, state.frame)
                        )
                broken = judge.broken(found)
                if broken:
                    reason = f"At {state.time:.4g} s {broken[0].sentence}."
                    break
                with ledger.phase("output"):
                    write_checkpoint(directory / CHECKPOINT_NAME, _checkpoint(session, state, certificate))
    seconds = perf_counter() - started
    write_summary(directory / SUMMARY_NAME, _summary(session, state, certificate, reason, seconds, warm, directory))
    return open_run(directory)


def _judge(session: Session) -> Judge:
    return judge_of(world_surfaces(session.built.world), session.scene.effects, session.built.energies)


def _scripted(built: Built) -> bool:
    """True where a body or a pin moves."""
    held = built.constraints.values()
    return not all([*(body.motion.still for body in built.world.bodies), *(constraint.still for constraint in held)])


def _entry(report: StepReport, certificate: Certificate) -> dict[str, Any]:
    """A line of the record."""
    return {
        "step": report.state.step,
        "time": report.state.time,
        "dt": report.dt,
        "newton_iterations": report.result.iterations,
        "speed": report.result.speed,
        "residual": report.result.residual,
        "energy": certificate.energy,
        "minimum_gap": report.minimum_gap,
        "fastest": report.fastest,
        "failures": list(report.failures),
    }


def _progress(report: StepReport, session: Session, certificate: Certificate, seconds: float) -> Progress:
    run, integrator = session.scene.run_settings(), session.integrator
    verdict = "moving"
    if report.dt < integrator.dt / 8:
        verdict = "stalled"
    elif report.fastest < 10 * integrator.settings.tolerance:
        verdict = "settled"
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


def _summary(
    session: Session,
    state: State,
    certificate: Certificate,
    reason: str,
    seconds: float,
    warm: float,
    directory: Path,
) -> dict[str, Any]:
    """What DESIGN's contract asks of summary.json, and the notes that were printed."""
    world, potential = session.built.world, session.integrator.potential
    record = read_record(directory / RECORD_NAME)
    return {
        "status": "failed" if reason else "completed",
        "reason": reason or f"{state.time:g} s were simulated.",
        "stages": ["start", *("simulated" for _ in range(state.frame))],
        "wall_seconds": seconds,
        "warmup_seconds": warm,
        "steps": state.step,
        "newton_iterations": sum(entry["newton_iterations"] for entry in record),
        "linear_solves": potential.ledger.linear_solves,
        "peak_memory_bytes": peak_memory(),
        "vertices": world.n_cloth,
        "triangles": len(world.triangles),
        "solver": session.integrator.system.solver.name,
        "notes": list(session.notes),
        "effects": potential.accounts(),
        "off": session.built.off,
        "phases": potential.ledger.phases,
        "certificate": certificate.as_dict(_judge(session).says()),
    }


def _checkpoint(session: Session, state: State, certificate: Certificate) -> Checkpoint:
    potential = session.integrator.potential
    counters = {
        "certificate": certificate.as_json(),
        "effects": potential.accounts(),
        "phases": potential.ledger.phases,
        "linear_solves": potential.ledger.linear_solves,
    }
    return Checkpoint(
        time=state.time,
        dt=state.dt,
        frame=state.frame,
        step=state.step,
        positions=state.positions,
        velocities=state.velocities,
        stiffness=0.0,  # set anew from the state at each step: nothing to keep
        scene_text=session.scene.to_text(),
        counters=counters,
    )


def _restore(ledger: Ledger, counters: dict[str, Any]) -> None:
    """Go on counting where the stopped run was."""
    for name, account in counters["effects"].items():
        ledger.effects[name] = Account(**account)
    ledger.phases.update(counters["phases"])
    ledger.linear_solves = counters["linear_solves"]


def _refuse_leaps(world: World, dt: float) -> None:
    """InputError for a body that turns so far in a step that its vertices' straight ways are no arcs any more."""
    for body in world.bodies:
        if not isinstance(body.motion, RigidMotion):
            continue  # frames are straight between their times already
        turn = float(np.degrees(np.linalg.norm(body.motion.angular_velocity)) * dt)
        if turn > LARGEST_TURN:
            raise InputError(
                f"{body.name} turns {turn:.4g} degrees in a step, and contact follows it on straight ways.",
                f"Take solver.dt below {dt * LARGEST_TURN / turn:.2g} s.",
            )


def _set_threads(threads: int) -> None:
    """Threads of ipctk, where a scene has loaded it; the linear solver is told when it is made."""
    if "ipctk" in sys.modules:
        sys.modules["ipctk"].set_num_threads(threads or os.cpu_count() or 1)


def peak_memory() -> int:
    """The largest resident memory of this process so far [bytes]; 0 where the system does not tell."""
    try:
        import resource
    except ImportError:  # Windows
        return 0
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else 1024 * peak


def _remove(file: Path) -> None:
    """The summary of an earlier run, which the new one no longer is."""
    try:
        file.unlink(missing_ok=True)
    except OSError as error:
        raise InputError(f"{file} cannot be replaced: {error.strerror}.", "Choose another directory.") from error


def _make_directory(directory: Path) -> None:
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"{directory} cannot be made a directory: {error.strerror}.", "Choose another with -o."
        ) from error
