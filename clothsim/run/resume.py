"""Runs in a directory, which is made, locked and cleared on request: begun, or continued from the checkpoint."""

import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from clothsim.base.errors import InputError
from clothsim.base.file_reading import read_regular_file
from clothsim.base.file_writing import make_directory, refuse_replacing
from clothsim.base.inputs import refuse_uncallable
from clothsim.base.process_memory import Stopwatch
from clothsim.base.record import FITTED_NAME, RECORD_NAME, SUMMARY_NAME
from clothsim.files.runs.checkpoint import CHECKPOINT_NAME, read_checkpoint
from clothsim.files.runs.run_lock import locked
from clothsim.files.runs.trajectory import TRAJECTORY_NAME
from clothsim.physics.energies.base import Energy
from clothsim.physics.energies.protocols import ContactGap, History
from clothsim.run.certificate import Certificate, certificate_from
from clothsim.run.checkpoints import restore
from clothsim.run.intersections import warn_of
from clothsim.run.recorded_run import Announcement, Listener, StepListener, recorded_run, watched
from clothsim.run.results import Run
from clothsim.run.session import check_displacement_per_step, prepare
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.cost import expected_cost
from clothsim.scene.scene import Scene, scene_from_text
from clothsim.solve.stepping.state import State, first_state

MORE_VERTICES = 2
"""Times as many vertices as a checkpoint has, beyond which a scene that is estimated so is another one."""
RUN_FILES = (TRAJECTORY_NAME, RECORD_NAME, SUMMARY_NAME, CHECKPOINT_NAME)


@contextmanager
def new_output(directory: Path, overwrite: bool) -> Iterator[None]:
    """Make and lock a directory for a new run; a link among its files is replaced, not followed.

    InputError if it cannot be made, another run writes there, or it holds an earlier run without `overwrite`.
    """
    make_directory(directory)
    with locked(directory):
        refuse_earlier_run(directory, overwrite)
        for file in (directory / name for name in RUN_FILES):  # a checkpoint must not meet another run's trajectory
            try:
                file.unlink(missing_ok=True)  # or a link in its place
            except OSError as error:
                raise InputError(
                    f"{file} cannot be replaced: {error.strerror}.", "Choose another directory."
                ) from error
        yield


@contextmanager
def continued_output(directory: Path) -> Iterator[None]:
    """Lock the directory of a run that goes on. InputError if another run writes there, or a file is a link."""
    with locked(directory):
        for file in (directory / name for name in RUN_FILES):
            if file.is_symlink():
                raise InputError(f"{file} is a link, and a run writes no file outside of its directory.", "Copy it.")
        yield


def refuse_earlier_run(
    directory: Path, overwrite: bool, names: Iterable[str] = (), inputs: Iterable[object] = ()
) -> None:
    """InputError if a command would replace an earlier run, or a file that no run wrote, without `overwrite`.

    names: the files that the command writes besides those of a run; inputs: what it reads: files, the directories of
    runs, and scenes with the files that they name, none of which is ever replaced.
    """
    if not os.path.isdir(directory):
        return
    files = [directory / name for name in (*RUN_FILES, *names)]
    read = [file for given in inputs for file in (given.files if isinstance(given, Scene) else (given,))]
    refuse_replacing(files, True, read)
    if any(isinstance(file, str | Path) and Path(file).resolve() == directory.resolve() for file in read):
        raise InputError(f"{directory} is read, and would be replaced by the output.", "Choose another with -o.")
    if overwrite:
        return
    unfinished = os.path.isfile(directory / CHECKPOINT_NAME) and not os.path.isfile(directory / SUMMARY_NAME)
    if any(os.path.isfile(directory / name) for name in (SUMMARY_NAME, TRAJECTORY_NAME)) and not unfinished:
        raise InputError(
            f"{directory} holds an earlier run.", "Choose another directory with -o, or replace it: --overwrite."
        )
    if unfinished:
        raise InputError(
            f"{directory} holds a run that was stopped before its end.",
            f"Continue it with `clothsim resume {directory}`, or replace it: --overwrite.",
        )
    refuse_replacing(files, overwrite)


def begun_run(
    scene: Scene,
    directory: Path,
    listeners: tuple[Listener | None, StepListener | None],
    announcements: Iterable[Announcement | None],
    dump_iterates: int | None,
    permissions: tuple[bool, bool],
    budget: float | None = None,
) -> Run:
    """Simulate a scene with fixed settings; permissions: overwrite and force of `simulate`; budget: as there."""
    started = Stopwatch()
    overwrite, force = permissions
    session, log = watched(prepare(scene, build(scene)), dump_iterates, 0)
    if not force:
        built, dt = session.built, session.integrator.dt
        contact = any(isinstance(energy, ContactGap) for energy in built.energies.values())
        check_displacement_per_step(built.world, built.constraints.values(), dt, contact)
    with new_output(directory, overwrite):
        for announce in announcements:
            if announce is not None:
                announce(session)
        state = first_state(session.built.world, session.integrator.dt)
        run = recorded_run(
            session, state, Certificate(), directory, started, listeners, log, resumed=False, budget=budget
        )
    warn_of(run.intersections, session.built.energies)
    return run


def resume(
    directory: str | Path,
    progress: Listener | None = None,
    announce: Announcement | None = None,
    dump_iterates: int | None = None,
    on_step: StepListener | None = None,
) -> Run:
    """Continue a run from the checkpoint in its directory.

    With ``threads = 1`` the frames equal those of a run that was not stopped, bit for bit. A failed run fails again,
    from its last good state. If the directory has no trajectory, a new one starts at the checkpoint.

    Parameters
    ----------
    directory : str or Path
        The output directory of `simulate` or ``clothsim run``.
    progress, announce, dump_iterates, on_step
        As in `simulate`.

    Returns
    -------
    Run
        The whole run.

    Raises
    ------
    InputError
        The directory has no checkpoint, another run writes to it, a file of it is a link, its mesh files have changed,
        or it contains a finished fit.
    """
    refuse_uncallable(progress=progress, announce=announce, on_step=on_step)
    folder = Path(directory)
    summary = folder / SUMMARY_NAME
    if os.path.isfile(folder / FITTED_NAME) and summary.is_file() and b'"fit_seconds"' in read_regular_file(summary):
        raise InputError(
            f"{folder} is a finished fit.", "`clothsim bundle` it: its drape is replayed from the archive."
        )
    read_checkpoint(folder / CHECKPOINT_NAME)  # a directory without one gets no lock file either
    with continued_output(folder):
        # Continue the run of a locked directory
        started = Stopwatch()
        saved = read_checkpoint(folder / CHECKPOINT_NAME)
        scene = scene_from_text(saved.scene_text, folder)
        if expected_cost(scene).vertices > MORE_VERTICES * len(saved.state.positions):  # not built to find that out
            raise InputError(f"{folder} has another mesh than its checkpoint.", "Repeat the run from its scene.")
        session, log = watched(prepare(scene, build(scene)), dump_iterates, saved.state.step)
        if len(saved.state.positions) != session.built.world.n_vertices:
            raise InputError(f"{folder} has another mesh than its checkpoint.", "Restore the mesh files of the scene.")
        state = saved.state
        _refuse_another_state(state, scene)
        _refuse_another_memory(state, session.built.energies)
        try:
            restore(session.integrator.potential.timers, saved.counters)
            certificate = certificate_from(saved.counters["certificate"])
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise InputError(
                f"{folder / CHECKPOINT_NAME} has broken counters ({type(error).__name__}: {error}).",
                "Repeat the run from its scene.",
            ) from error
        if announce is not None:
            announce(session)
        run = recorded_run(session, state, certificate, folder, started, (progress, on_step), log, resumed=True)
        warn_of(run.intersections, session.built.energies)
        return run


LARGEST = 1e100
"""Bound on positions [m] and velocities [m/s] of a run that goes on: their squares are finite."""
SMALLEST_STEP = 1e-12
"""Time step of a checkpoint, as a fraction of the scene's, below which no run goes on."""


def _refuse_another_state(state: State, scene: Scene) -> None:
    """InputError for a time, a step, frames or positions that the scene does not come to: no run of it wrote them."""
    run, longest = scene.run_settings, scene.solver_settings.longest_step
    due = state.time * run.frames_per_second
    remedy = "Repeat the run from its scene."
    before = () if state.previous is None else (state.previous.positions, state.previous.velocities)
    if not all((np.abs(rows) < LARGEST).all() for rows in (state.positions, state.velocities, *before)):
        raise InputError(f"{CHECKPOINT_NAME} has a vertex that is not finite, or beyond {LARGEST:g} m.", remedy)
    if state.time > run.duration * (1 + 1e-9) + max(longest, 1 / run.frames_per_second):
        raise InputError(f"{CHECKPOINT_NAME} is at {state.time:.6g} s, its scene ends at {run.duration:g} s.", remedy)
    if state.dt < SMALLEST_STEP * longest:
        raise InputError(f"{CHECKPOINT_NAME} has a step of {state.dt:.6g} s, the scene one of {longest:g} s.", remedy)
    if state.frame > due * (1 + 1e-9) + 1 + 1e-6:  # the last frame may be due after the end of the run
        raise InputError(
            f"{CHECKPOINT_NAME} has {state.frame:,} frames at {state.time:.6g} s, and {due:.6g} are due.", remedy
        )


def _refuse_another_memory(state: State, energies: Mapping[str, Energy]) -> None:
    """InputError if an effect carries over other numbers than those of the scene, as those of an earlier version."""
    for name, energy in energies.items():
        if not isinstance(energy, History) or name not in state.memory:
            continue
        count = np.size(energy.carry_over)  # 0: any number, as of contacts
        try:
            saved = np.asarray(state.memory[name], np.float64)
        except (TypeError, ValueError):
            saved = np.zeros(0)
        if count and saved.size != count:
            raise InputError(
                f"{CHECKPOINT_NAME} has {saved.size:,} numbers of effects.{name}, the scene has {count:,}.",
                "Repeat the run from its scene.",
            )
