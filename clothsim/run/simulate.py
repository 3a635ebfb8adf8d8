"""The main job: a scene becomes frames, a record, a summary and a checkpoint in a directory."""

import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter

from clothsim.build.scene_world import Built, build
from clothsim.errors import InputError
from clothsim.io.checkpoint import CHECKPOINT_NAME, read_checkpoint, write_checkpoint
from clothsim.io.record import RECORD_NAME, SUMMARY_NAME, RecordWriter, read_record, write_summary
from clothsim.io.run_surfaces import world_surfaces
from clothsim.io.trajectory import TRAJECTORY_NAME, TrajectoryWriter, read_trajectory
from clothsim.run.results import Run, open_run
from clothsim.run.session import Session, prepare
from clothsim.run.summary import Progress, checkpoint_of, entry_of, progress_of, restore, state_of, summary_of
from clothsim.scene.scene import Scene, scene_from_text
from clothsim.sim.certificate import Certificate, certificate_from, world_stretches
from clothsim.sim.failure import Failure, crossing_failure
from clothsim.sim.intersection_check import Judge, judge_of
from clothsim.sim.iterate_log import IterateLog
from clothsim.sim.state import State, first_state
from clothsim.sim.stepping import StepReport
from clothsim.sim.time_loop import steps

FITTED = "fitted.obj"
"""What only a fit leaves."""

Listener = Callable[[Progress], None]
"""Called after each step."""

Announcement = Callable[[Session], None]
"""Called once, when the scene is ready and before the first step."""


def simulate(
    scene: Scene,
    output: str | Path | None = None,
    progress: Listener | None = None,
    announce: Announcement | None = None,
    dump_iterates: int | None = None,
) -> Run:
    """Simulate `scene`; leave trajectory, record, summary and checkpoint in `output` (None: a fresh temporary folder).

    A run that cannot go on ends with status "failed" and a sentence, and keeps its frames and its last good state.
    dump_iterates: a step, from 1, whose Newton iterates are written too (`sim.iterates`). InputError for bad input.
    """
    directory = Path(tempfile.mkdtemp(prefix="clothsim-") if output is None else output)
    started = perf_counter()
    session, log = _watched(prepare(scene, build(scene)), dump_iterates, 0)
    _make_directory(directory)
    if announce is not None:
        announce(session)
    state = first_state(session.built.world, session.integrator.dt)
    return _run(session, state, Certificate(), directory, started, progress, log, resumed=False)


def resume(
    directory: str | Path,
    progress: Listener | None = None,
    announce: Announcement | None = None,
    dump_iterates: int | None = None,
) -> Run:
    """Go on from the checkpoint in `directory`; with threads = 1 the frames equal an unstopped run's, bit for bit.

    Of a failed run that is its last good state: it fails again at once. A directory without a trajectory gets one that
    starts there. A finished fit is refused: it is more than its drape.
    """
    folder = Path(directory)
    _refuse_a_fit(folder)
    started = perf_counter()
    saved = read_checkpoint(folder / CHECKPOINT_NAME)
    scene = scene_from_text(saved.scene_text, folder)
    session, log = _watched(prepare(scene, build(scene)), dump_iterates, saved.step)
    if len(saved.positions) != session.built.world.n_vertices:
        raise InputError(f"{folder} has another mesh than its checkpoint.", "Restore the mesh files of the scene.")
    state = state_of(saved)
    restore(session.integrator.potential.ledger, saved.counters)
    if announce is not None:
        announce(session)
    certificate = certificate_from(saved.counters["certificate"])
    return _run(session, state, certificate, folder, started, progress, log, resumed=True)


def _watched(session: Session, step: int | None, done: int) -> tuple[Session, IterateLog | None]:
    """The session with a log of the Newton iterates of a step, which must come after the `done` ones."""
    if step is None:
        return session, None
    if step <= done:
        raise InputError(f"Step {step} cannot be dumped: {done} steps are done.", f"Name a step from {done + 1}.")
    log = IterateLog(step)
    return replace(session, integrator=replace(session.integrator, watch=log.watch)), log


@dataclass(frozen=True)
class _Output:
    """Where a run writes: its directory, the two files that grow, and the judge of its frames."""

    session: Session
    directory: Path
    trajectory: TrajectoryWriter
    record: RecordWriter
    judge: Judge

    def frame(self, state: State) -> None:
        """Append the state to the trajectory."""
        world = self.session.built.world
        stretches = world_stretches(world, state.positions)
        self.trajectory.append(state.time, state.positions + world.origin, stretches)

    def save(self, state: State, certificate: Certificate) -> None:
        """Write the checkpoint."""
        write_checkpoint(self.directory / CHECKPOINT_NAME, checkpoint_of(self.session, state, certificate))


def _run(
    session: Session,
    state: State,
    certificate: Certificate,
    directory: Path,
    started: float,
    progress: Listener | None,
    log: IterateLog | None,
    resumed: bool,
) -> Run:
    """Step to the end of the scene, writing as it goes; whatever stops it, the frames so far are on disk."""
    surfaces = world_surfaces(session.built.world)
    scripted = _scripted(session.built)
    asked = session.scene.solver_settings.error
    formula = session.integrator.formula
    certificate = replace(certificate, moved_by_script=scripted, formula=formula, asked=asked)
    judge = judge_of(surfaces, session.scene.effects, session.built.energies)
    kept = _frames_until(directory / TRAJECTORY_NAME, state.time) if resumed else None
    if not resumed:
        _remove(directory / SUMMARY_NAME)
    with (
        TrajectoryWriter(directory / TRAJECTORY_NAME, surfaces, resume_at=kept) as trajectory,
        RecordWriter(directory / RECORD_NAME, resume_at=state.step if resumed else None) as record,
    ):
        _remove(directory / SUMMARY_NAME)  # of a resumed run only now: one that cannot go on keeps what it has
        output = _Output(session, directory, trajectory, record, judge)
        if kept is None:
            output.frame(state)
        if not resumed:
            if judge.crossings(state.positions):
                certificate = replace(certificate, intersecting_frames=(0,))
            output.save(state, certificate)
        warm = perf_counter() - started

        def heard(report: StepReport) -> None:
            if progress is not None:
                progress(progress_of(report, session, perf_counter() - started))

        state, certificate, failure = _stepped(output, state, certificate, log, heard)
    seconds = {"wall_seconds": perf_counter() - started, "warmup_seconds": warm}
    entries = read_record(directory / RECORD_NAME)
    write_summary(directory / SUMMARY_NAME, summary_of(session, state, certificate, judge, failure, entries, seconds))
    return open_run(directory)


def _stepped(
    output: _Output,
    state: State,
    certificate: Certificate,
    log: IterateLog | None,
    heard: Callable[[StepReport], None],
) -> tuple[State, Certificate, Failure | None]:
    """All steps from `state` to the end or to a failure; the last state, its certificate, why it failed."""
    session, run = output.session, output.session.scene.run_settings
    world, ledger = session.built.world, session.integrator.potential.ledger
    for report in steps(session.integrator, state, run.duration, run.frames_per_second):
        if log is not None and log.step == state.step + 1:
            log.write(output.directory)
        if report.failure is not None:
            output.save(state, certificate)
            return state, certificate, report.failure
        before, state = state, report.state
        with ledger.phase("certificate"):
            certificate = certificate.after(world, report, before)
        with ledger.phase("output"):
            output.record.append(entry_of(report, certificate))
        heard(report)
        if not report.frame_done:
            continue
        with ledger.phase("output"):
            output.frame(state)
        with ledger.phase("certificate"):
            found = output.judge.crossings(state.positions)
        if found:
            frames = (*certificate.intersecting_frames, state.frame)
            certificate = replace(certificate, intersecting_frames=frames)
        broken = output.judge.broken(found)
        if broken:
            return state, certificate, crossing_failure(world, broken[0], state, report.dt)
        with ledger.phase("output"):
            output.save(state, certificate)
    return state, certificate, None


def _frames_until(path: Path, time: float) -> int | None:
    """How many frames of a trajectory are not later than `time` [s]; None where there is no trajectory."""
    return int((read_trajectory(path).times <= time).sum()) if path.is_file() else None


def _scripted(built: Built) -> bool:
    """True where a body or a pin moves, or where the wind blows."""
    held = built.constraints.values()
    still = all([*(body.motion.still for body in built.world.bodies), *(constraint.still for constraint in held)])
    return not still or any(energy.drives for energy in built.energies.values())


def _remove(file: Path) -> None:
    """The summary of an earlier run, which the new one no longer is."""
    try:
        file.unlink(missing_ok=True)
    except OSError as error:
        raise InputError(f"{file} cannot be replaced: {error.strerror}.", "Choose another directory.") from error


def _refuse_a_fit(folder: Path) -> None:
    """A finished drape that is run on would be called completed, whatever was said of the fit."""
    summary = folder / SUMMARY_NAME
    if (folder / FITTED).is_file() and summary.is_file() and b'"fit_seconds"' in summary.read_bytes():
        raise InputError(
            f"{folder} is a finished fit.", "`clothsim bundle` it: its drape is replayed from the archive."
        )


def _make_directory(directory: Path) -> None:
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"{directory} cannot be made a directory: {error.strerror}.", "Choose another with -o."
        ) from error
