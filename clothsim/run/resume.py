"""Continuation of a run from its checkpoint."""

from pathlib import Path
from time import perf_counter

from clothsim.base.errors import InputError
from clothsim.base.inputs import refuse_uncallable
from clothsim.base.record import FITTED_NAME, SUMMARY_NAME
from clothsim.files.runs.checkpoint import CHECKPOINT_NAME, read_checkpoint
from clothsim.run.certificate.certificate import certificate_from
from clothsim.run.checked_step import warn_of
from clothsim.run.output_directory import continued_output
from clothsim.run.recorded_run import Announcement, Listener, StepListener, recorded_run, watched
from clothsim.run.results import Run
from clothsim.run.session import prepare
from clothsim.run.summary import restore, state_of
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.scene import scene_from_text


def resume(
    directory: str | Path,
    progress: Listener | None = None,
    announce: Announcement | None = None,
    dump_iterates: int | None = None,
    on_step: StepListener | None = None,
) -> Run:
    """Continue a run from the checkpoint in its directory.

    With ``threads = 1`` the frames equal those of a run that was not stopped, bit for bit. A failed run fails again,
    from its last good state. A directory without a trajectory gets one that starts there.

    Parameters
    ----------
    directory : str or Path
        The output directory of `simulate` or ``clothsim run``.
    progress, announce, dump_iterates, on_step
        As of `simulate`.

    Returns
    -------
    Run
        The whole run.

    Raises
    ------
    InputError
        The directory has no checkpoint, another run writes to it, a file of it is a link, its mesh files have changed,
        or it is a finished fit, which is more than its drape.
    """
    refuse_uncallable(progress=progress, announce=announce, on_step=on_step)
    folder = Path(directory)
    _refuse_a_fit(folder)
    read_checkpoint(folder / CHECKPOINT_NAME)  # a directory without one gets no lock file either
    with continued_output(folder):
        return _continued(folder, (progress, on_step), announce, dump_iterates)


def _continued(
    folder: Path,
    listeners: tuple[Listener | None, StepListener | None],
    announce: Announcement | None,
    dump_iterates: int | None,
) -> Run:
    """Continue the run of a locked directory."""
    started = perf_counter()
    saved = read_checkpoint(folder / CHECKPOINT_NAME)
    scene = scene_from_text(saved.scene_text, folder)
    session, log = watched(prepare(scene, build(scene)), dump_iterates, saved.step)
    if len(saved.positions) != session.built.world.n_vertices:
        raise InputError(f"{folder} has another mesh than its checkpoint.", "Restore the mesh files of the scene.")
    state = state_of(saved)
    restore(session.integrator.potential.timers, saved.counters)
    certificate = certificate_from(saved.counters["certificate"])
    if announce is not None:
        announce(session)
    run = recorded_run(session, state, certificate, folder, started, listeners, log, resumed=True)
    warn_of(run.intersections, session.built.energies)
    return run


def _refuse_a_fit(folder: Path) -> None:
    """InputError for a finished fit: its drape alone would count as completed, whatever the status of the fit."""
    summary = folder / SUMMARY_NAME
    if (folder / FITTED_NAME).is_file() and summary.is_file() and b'"fit_seconds"' in summary.read_bytes():
        raise InputError(
            f"{folder} is a finished fit.", "`clothsim bundle` it: its drape is replayed from the archive."
        )
