"""The steps of a run, written to a directory as they are taken; interruption, and a log of Newton's iterates.

`iterates_STEP.npz` is a NumPy archive (no pickle). A step is solved once or, after failures, several times:
  dts (s,)                  length of the step in each solve [s]
  solve (k,)                solve of each iterate, 0..s-1; its first iterate is the start
  positions (k, N, 3)       all rows of x: cloths, bodies, ghosts [m], relative to `world.origin`
  fraction (k,)             fraction of the Newton step that contact and line search allowed; 0 at a start, nan after a
                            nonlinear elimination (`linear_system.Patch`)
  speed (k,)                |dx|_inf / dt of that full step [m/s]; nan at a start and after an elimination
  residual (k,)             largest force where that step began [N]; nan also while Dirichlet vertices are displaced
  energy (k,)               E(x) of the step [J]
"""

from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path
from time import perf_counter
from types import TracebackType
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from clothsim.base.errors import InputError
from clothsim.base.file_writing import write_atomically
from clothsim.base.interruption import InterruptFlag, interruption
from clothsim.base.process_memory import Stopwatch
from clothsim.base.record import RECORD_NAME, SUMMARY_NAME, RecordWriter, read_record, write_summary
from clothsim.files.runs.checkpoint import CHECKPOINT_NAME, Checkpoint, write_checkpoint
from clothsim.files.runs.trajectory import TRAJECTORY_NAME, TrajectoryWriter, read_trajectory
from clothsim.files.runs.vtkhdf import STRETCHES, FrameArray
from clothsim.geometry.intersection.proved_separations import Effort, ProvedSeparations
from clothsim.mesh.world import world_surfaces
from clothsim.physics.energies.protocols import is_driven, with_material_at
from clothsim.run.certificate import Certificate
from clothsim.run.checkpoints import checkpoint_of, scene_text
from clothsim.run.fields import FIELDS, Configuration, at_start, field, world_stretches
from clothsim.run.intersections import IntersectionCheck, intersection_check_of
from clothsim.run.results import Run, open_run
from clothsim.run.session import Session
from clothsim.run.step_reports import Progress, SimulationState, progress_of, record_entry, state_after, step_forces
from clothsim.run.summary import summary_of
from clothsim.solve.newton.outcome import Iterate, Observer, unobserved
from clothsim.solve.newton.potential import Potential
from clothsim.solve.stepping.failure import Failure, crossing_failure
from clothsim.solve.stepping.state import State
from clothsim.solve.stepping.stepping import StepReport, Watch
from clothsim.solve.stepping.time_loop import steps

if TYPE_CHECKING:
    from clothsim.geometry.intersection.crossings import Crossing

MOST_BYTES = 1 << 29
"""Bound on the logged positions, 512 MiB: beyond it the first iterates are dropped."""


def iterates_name(step: int) -> str:
    """Return the file name of a step."""
    return f"iterates_{step}.npz"


class IterateLog:
    """Log of the iterates of step number `step` (from 1); `watch` goes to an Integrator."""

    def __init__(self, step: int) -> None:
        self.step = step
        self._dts: list[float] = []
        self._logged: deque[tuple[int, Iterate, float]] = deque()

    def watch(self, step: int, dt: float, potential: Potential) -> Observer:
        """Return the observer of a solve: this log for its own step."""
        if step != self.step:
            return unobserved
        self._dts.append(dt)
        solve = len(self._dts) - 1

        def observe(iterate: Iterate) -> None:
            # not `potential.value`, whose timers count the run's own evaluations
            energy = sum(energy.value(iterate.x) for energy in potential.acting.values())
            self._logged.append((solve, iterate, float(energy)))
            if len(self._logged) * iterate.x.nbytes > MOST_BYTES:
                self._logged.popleft()

        return observe

    def write(self, directory: Path) -> None:
        """Write the file into `directory`, if the step was begun; InputError where that fails."""
        if not self._dts:  # a budget was spent before
            return
        content = BytesIO()
        np.savez(
            content,
            dts=np.array(self._dts),
            solve=np.array([solve for solve, _, _ in self._logged], np.int64),
            positions=np.array([iterate.x for _, iterate, _ in self._logged]),
            fraction=np.array([iterate.fraction for _, iterate, _ in self._logged]),
            speed=np.array([iterate.speed for _, iterate, _ in self._logged]),
            residual=np.array([iterate.residual for _, iterate, _ in self._logged]),
            energy=np.array([energy for _, _, energy in self._logged]),
        )
        write_atomically(directory / iterates_name(self.step), content.getvalue())


def interruptible(session: Session, flag: InterruptFlag) -> Session:
    """The session with the flag read at every iterate of every solve."""
    watch = session.integrator.watch

    def watched(step: int, dt: float, potential: Potential) -> Observer:
        flag.check()
        observe = watch(step, dt, potential)

        def observed(iterate: Iterate) -> None:
            flag.check()
            observe(iterate)

        return observed

    checked: Watch = watched
    return replace(session, integrator=replace(session.integrator, watch=checked))


SECONDS_BETWEEN_CHECKPOINTS = 30.0
"""Wall time after which a frame is also written as a checkpoint: what a killed process loses, and a frame [s]."""

_CARRIED = "carried"
"""The array that no key asks for: 1 for a vertex that a body carries through a pinch, 0 for others."""

Listener = Callable[[Progress], None]
"""Called after each step."""

StepListener = Callable[[SimulationState], None]
"""Called after each step with the state at its end."""

Announcement = Callable[[Session], None]
"""Called once, when the scene is ready and before the first step."""


def watched(session: Session, step: int | None, done: int) -> tuple[Session, IterateLog | None]:
    """The session with a log of the Newton iterates of a step later than the `done` ones."""
    if step is None:
        return session, None
    if step <= done:
        raise InputError(f"Step {step} cannot be dumped: {done} steps are done.", f"Name a step from {done + 1}.")
    log = IterateLog(step)
    return replace(session, integrator=replace(session.integrator, watch=log.watch)), log


class _Checkpoints:
    """The checkpoint of the last good state, on disk every SECONDS_BETWEEN_CHECKPOINTS and at the end of the block."""

    def __init__(self, directory: Path) -> None:
        self._path = directory / CHECKPOINT_NAME
        self._due: Checkpoint | None = None
        self._written = perf_counter()

    def __enter__(self) -> "_Checkpoints":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with suppress(*([] if error is None else [InputError])):  # a full disk ended the run: the one on it stays
            self._write()

    def offer(self, checkpoint: Checkpoint) -> None:
        """Take a later state; it is written where the time has come."""
        self._due = checkpoint
        if perf_counter() - self._written >= SECONDS_BETWEEN_CHECKPOINTS:
            self._write()

    def _write(self) -> None:
        due, self._due = self._due, None
        if due is not None:
            write_checkpoint(self._path, due)
            self._written = perf_counter()


@dataclass(frozen=True)
class _Output:
    """The directory of a run, its two files that grow, its checkpoints, and the intersection check of its states.

    text: the scene of all checkpoints; budget: CPU time of the steps [s].
    """

    session: Session
    directory: Path
    text: str
    budget: float | None
    trajectory: TrajectoryWriter
    record: RecordWriter
    checkpoints: _Checkpoints
    check: IntersectionCheck

    def frame(self, state: State, report: StepReport | None = None) -> None:
        """Append the state to the trajectory; report: of the step that ended there."""
        world = self.session.built.world
        stretches = world_stretches(world, state.positions)
        fields = _written_fields(self.session, state, report)
        self.trajectory.append(state.time, state.positions + world.origin, stretches, fields)

    def checked(
        self, state: State, certificate: Certificate, is_frame: bool
    ) -> "tuple[Certificate, tuple[Crossing, ...]]":
        """The certificate with the intersections of the state by the exact check, and those."""
        return _checked(self.check, self.session, state, certificate, is_frame)

    def save(self, state: State, certificate: Certificate) -> None:
        """Make the state the one from which the run can go on."""
        self.checkpoints.offer(checkpoint_of(self.session, state, certificate, self.text))


def recorded_run(
    session: Session,
    state: State,
    certificate: Certificate,
    directory: Path,
    started: Stopwatch,
    listeners: tuple[Listener | None, StepListener | None],
    log: IterateLog | None,
    resumed: bool,
    on_report: Callable[[StepReport], None] | None = None,
    budget: float | None = None,
) -> Run:
    """Step to the end of the scene and write each frame when it is done.

    on_report: called with each step taken; budget: CPU time of the steps [s], in place of that of the scene.
    """
    surfaces = world_surfaces(session.built.world)
    built = session.built
    moving = [*(body.motion for body in built.world.bodies), *built.constraints.values()]
    scripted = not all(each.still for each in moving) or any(map(is_driven, built.energies.values()))
    asked = session.scene.solver_settings.error
    certificate = replace(certificate, moved_by_script=scripted, asked=asked)
    if session.integrator.flypapers and certificate.flypapered is None:
        from clothsim.solve.pinch.flypaper import PinchRecord  # runs without the policy do not import it

        certificate = replace(certificate, flypapered=PinchRecord())
    check = intersection_check_of(surfaces, session.scene.effects, session.built.energies, ProvedSeparations())
    arrays = [_frame_array(name, values.shape[1:]) for name, values in _written_fields(session, state, None).items()]
    file = directory / TRAJECTORY_NAME
    resume_frame = int((read_trajectory(file).times <= state.time).sum()) if resumed and file.is_file() else None
    text = scene_text(session, directory)
    if not resumed:
        # The checkpoint first: where the disk is full before the first frame is written, the run can still go on.
        certificate, _ = _checked(check, session, state, certificate, is_frame=True)
        write_checkpoint(directory / CHECKPOINT_NAME, checkpoint_of(session, state, certificate, text))
    with (
        interruption() as flag,  # before the files: within a call of HDF5 a KeyboardInterrupt is lost
        _Checkpoints(directory) as checkpoints,
        TrajectoryWriter(directory / TRAJECTORY_NAME, surfaces, resume_at=resume_frame, fields=arrays) as trajectory,
        RecordWriter(directory / RECORD_NAME, resume_at=state.step if resumed and state.step else None) as record,
    ):
        (directory / SUMMARY_NAME).unlink(missing_ok=True)  # not before: one that cannot continue keeps it
        budget = session.scene.run_settings.budget if budget is None else budget
        output = _Output(session, directory, text, budget, trajectory, record, checkpoints, check)
        if not resume_frame:
            output.frame(state)
        warm = started.wall_seconds()

        def after_step(report: StepReport) -> None:
            progress, on_step = listeners
            if progress is not None:
                progress(progress_of(report, session, started.wall_seconds()))
            if on_step is not None:
                on_step(state_after(session.built.world, report))
            if on_report is not None:
                on_report(report)

        output = replace(output, session=interruptible(session, flag))
        state, certificate, failure = _stepped(output, state, certificate, log, after_step, flag)
    seconds = {
        "wall_seconds": started.wall_seconds(),
        "warmup_seconds": warm,
        "cpu_seconds": started.cpu_seconds(),
    }
    entries = read_record(directory / RECORD_NAME)
    write_summary(directory / SUMMARY_NAME, summary_of(session, state, certificate, check, failure, entries, seconds))
    return open_run(directory)


def _stepped(
    output: _Output,
    state: State,
    certificate: Certificate,
    log: IterateLog | None,
    after_step: Callable[[StepReport], None],
    flag: InterruptFlag,
) -> tuple[State, Certificate, Failure | None]:
    """Take all steps from `state` to the end or to a failure: the last state, its certificate, the failure."""
    session, run = output.session, output.session.scene.run_settings
    world, timers = session.built.world, session.integrator.potential.timers
    for report in steps(session.integrator, state, run.duration, run.frames_per_second, run.until, output.budget):
        if log is not None and log.step == state.step + 1:
            log.write(output.directory)
        if report.failure is not None:
            output.save(state, certificate)
            return state, certificate, report.failure
        before, state = state, report.state
        with timers.phase("certificate"):
            certificate = certificate.after(world, report, before, session.built.energies)
            certificate, found = output.checked(state, certificate, report.frame_done)
            if certificate.flypapered is not None:
                record = certificate.flypapered.after(world, before, state, found)
                certificate = replace(certificate, flypapered=record)
            if report.frame_done and world.bodies:
                energies = report.potential.energies.values()
                pinched = certificate.pinched.after(world, energies, state.positions, state.time)
                certificate = replace(certificate, pinched=pinched)
        with timers.phase("output"):
            forces = {"forces": step_forces(session.built, report)} if run.forces else {}
            output.record.append({**record_entry(report, certificate), **forces})
        after_step(report)
        if report.frame_done:
            with timers.phase("output"):
                output.frame(state, report)
        broken = output.check.violations(found)
        if broken:
            return state, certificate, crossing_failure(broken[0], state, report.dt)
        if report.frame_done:
            with timers.phase("output"):
                output.save(state, certificate)
        flag.check()
    return state, certificate, None


def _written_fields(session: Session, state: State, report: StepReport | None) -> dict[str, NDArray[np.floating]]:
    """The fields of a frame that the scene asks for, in the order of the table.

    Without the report of a step the fields of contact are zero: contact has its stiffness from a step.
    """
    world, asked = session.built.world, set(session.scene.run_settings.fields) - {STRETCHES.name}
    unbound = with_material_at(session.built.energies, state.time)
    energies = unbound if report is None else report.potential.energies
    at = Configuration(world, state.positions, energies, bound=report is not None)
    fields: dict[str, NDArray[np.floating]] = {
        name: at_start(name, world) if report is None and FIELDS[name].in_step else field(name, at)
        for name in FIELDS
        if name in asked
    }
    if session.integrator.flypapers:
        from clothsim.solve.pinch.pinch import flypapered_mask  # runs without the policy do not import it

        fields[_CARRIED] = flypapered_mask(world, state.memory).astype(np.float64)
    return fields


def _frame_array(name: str, components: tuple[int, ...]) -> FrameArray:
    """The array of a field in the trajectory."""
    location = "vertex" if name == _CARRIED else FIELDS[name].location
    if location == "triangle":
        return FrameArray(name, "triangle", components)
    return FrameArray(name, "vertex", components, "body" if location == "body" else "cloth")


def _checked(
    check: IntersectionCheck, session: Session, state: State, certificate: Certificate, is_frame: bool
) -> "tuple[Certificate, tuple[Crossing, ...]]":
    """The certificate with the intersections of a state, and those."""
    with session.integrator.potential.timers.phase("exact check"):
        found = check.crossings_of(state, session.built.world.origin)
    history = certificate.intersections.after(check, found, state, is_frame)
    checks = certificate.checks + (Effort() if check.proofs is None else check.proofs.take_effort())
    return replace(certificate, intersections=history, checks=checks), found
