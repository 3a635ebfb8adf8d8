"""Fit of a garment to another body: transfer, repair and drape."""

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

from clothsim.arrays import Floats
from clothsim.errors import InputError
from clothsim.fitting.distortion import Cost, cost_of
from clothsim.fitting.inputs import Figure, read_figure, read_garment, worn_in_scene
from clothsim.fitting.markers import NO_MARKERS, read_markers
from clothsim.fitting.moving_body import BODY, REST, START, draped
from clothsim.fitting.penetration import Counts
from clothsim.fitting.pipeline import Seeded, Task, seeded
from clothsim.fitting.stage import Garment, Stage, StageCallback, staged
from clothsim.io.checkpoint import CHECKPOINT_NAME
from clothsim.io.obj_writer import write_obj
from clothsim.io.record import RECORD_NAME, SUMMARY_NAME, read_summary, write_summary
from clothsim.io.results import Run
from clothsim.io.trajectory import TRAJECTORY_NAME
from clothsim.run.simulate import FITTED, Announcement, Listener
from clothsim.scene.fabrics import fabric_named
from transfer.signed_distance import body_surface

LEFT = (SUMMARY_NAME, RECORD_NAME, TRAJECTORY_NAME, CHECKPOINT_NAME, FITTED, REST, START, BODY)
"""Files of a fit in its directory."""
REMEDY = "Look at fit.png, and at the garment on its own body: `clothsim check GARMENT --on BODY -o FILE`."
FALLING = 0.5
"""Largest speed at the end of a drape [m/s] for a garment that rests on the body."""


@dataclass(frozen=True)
class Fit:
    """Result of `fit`.

    Attributes
    ----------
    directory : Path
        Output directory.
    status : str
        "completed" (simulated to its end), "refined" (the garment is free of intersections, but its simulation did not
        complete) or "failed".
    reason : str
        Reason for the status, one sentence.
    garment : Garment
        Garment as given.
    source, target : Figure
        Body that the garment was made for, and body that it is fitted to.
    stages : tuple of Stage
        Stages in order, each with positions and penetration counts.
    run : Run or None
        Drape; None where none was started.
    cost : Cost
        Stretches and displacement of the garment.
    notes : tuple of str
        Choices made in reading and fitting.

    Examples
    --------
    >>> import clothsim
    >>> fit = clothsim.fit("shirt.obj", "tall.obj", made_for="small.obj")  # doctest: +SKIP
    >>> fit.status, fit.positions.shape, fit.counts.clean  # doctest: +SKIP
    ('completed', (4210, 3), True)
    """

    directory: Path
    status: str
    reason: str
    garment: Garment
    source: Figure
    target: Figure
    stages: tuple[Stage, ...]
    run: Run | None
    cost: Cost
    notes: tuple[str, ...]

    @property
    def positions(self) -> Floats:
        """Positions of the fitted garment, (n, 3) [m]."""
        return self.stages[-1].positions

    @property
    def counts(self) -> Counts:
        """Penetration counts of the fitted garment by the exact check; clean unless the fit failed."""
        return self.stages[-1].counts


def fit(
    garment: str | Path,
    to: str | Path,
    made_for: str | Path | None = None,
    output: str | Path | None = None,
    *,
    scale: float | None = None,
    body_group: str | None = None,
    part: tuple[int, int] | None = None,
    weld: float = 0.0,
    fabric: str = "cotton",
    resize: bool = True,
    markers: str | Path | None = None,
    on_stage: StageCallback = lambda stage: None,
    progress: Listener | None = None,
    announce: Announcement | None = None,
) -> Fit:
    """Fit a garment made for one body to another body.

    The output directory holds the files of a run, `fitted.obj`, and the stages in summary.json; files of an earlier fit
    there are removed.

    Parameters
    ----------
    garment : str or Path
        Mesh file, MakeHuman clothes (.mhclo), or scene file (.toml), which then gives its own body, unit, part and
        seams.
    to : str or Path
        Body to fit to: mesh or scene file.
    made_for : str or Path, optional
        Body that the garment lies on; None: `to`, on which the garment is repaired.
    output : str or Path, optional
        Output directory; None: a new temporary one.
    scale : float, optional
        Length of a file unit of garment and `made_for` [m]; None: from the height of the body.
    body_group : str, optional
        Group of the body files.
    part : (int, int), optional
        First and last vertex of the garment in its file.
    weld : float
        Border vertices closer than that are sewn [m].
    fabric : str
        Name of a fabric.
    resize : bool
        True: the transferred garment is its rest shape; False: the given rest shape is kept.
    markers : str or Path, optional
        File of corresponding points, six numbers a line; None: derived where the meshes of the bodies differ.
    on_stage : callable
        Called with each `Stage` as it ends.
    progress, announce : callable, optional
        Callbacks of the drape, as in `simulate`.

    Returns
    -------
    Fit

    Raises
    ------
    InputError
        Invalid files or arguments.

    Examples
    --------
    >>> import clothsim
    >>> clothsim.fit("shirt.obj", "tall.obj", made_for="small.obj").status  # doctest: +SKIP
    'completed'
    >>> clothsim.fit("shirt.obj", "tall.obj", output="out", fabric="paper")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    clothsim.errors.InputError: ...
    """
    started = perf_counter()
    directory = Path(tempfile.mkdtemp(prefix="clothsim-fit-") if output is None else output)
    fabric_named("fabric", fabric)
    if Path(garment).suffix.lower() == ".toml":
        if made_for is not None or scale is not None or part is not None or weld:
            raise InputError(
                f"{garment} is a scene: its body, unit, part and seams are its own.",
                "Leave --from, --scale, --part and --weld out, or give the garment's file.",
            )
        worn, source = worn_in_scene(garment)
        target = source if _same_file(garment, to) else read_figure(to, group=body_group)
    else:
        source = read_figure(made_for or to, scale=scale, group=body_group)
        target = source if _same_file(made_for or to, to) else read_figure(to, group=body_group)
        worn = read_garment(garment, made_for or to, source.scale, part=part, weld=weld)
        _refuse_a_body(worn, source, target)
    places = NO_MARKERS if markers is None else read_markers(markers)
    _make_directory(directory, [Path(file) for file in (garment, to, made_for) if file is not None])
    task = Task(worn, source, target, fabric, resize, directory, on_stage, places)
    found = seeded(task)
    return _simulated(task, found, started, progress, announce)


def _simulated(
    task: Task, found: Seeded, started: float, progress: Listener | None, announce: Announcement | None
) -> Fit:
    """Drape the garment and write the results."""
    ended = _Ended("failed", found.failure, None, found.stages)
    if not found.failure:
        ended = _draped(task, found, progress, announce)
    status, reason, run, stages = ended
    if not stages[-1].counts.clean:  # self_contact was off, or nothing freed it
        status = "failed"
    done = Fit(
        task.folder,
        status,
        reason,
        task.garment,
        task.source,
        task.target,
        stages,
        run,
        cost_of(task.garment, stages[-1].positions),
        (*task.garment.notes, *task.source.notes, *(() if task.same_body else task.target.notes), *found.notes),
    )
    _write(done, perf_counter() - started)
    return done


class _Ended(NamedTuple):
    """End of a drape."""

    status: str
    reason: str
    run: Run | None
    stages: tuple[Stage, ...]


def _draped(task: Task, found: Seeded, progress: Listener | None, announce: Announcement | None) -> _Ended:
    """Drape; where it cannot start or complete, its start is the result, with status refined."""
    body = body_surface(task.target.positions, task.target.triangles)
    runs: list[Run] = []

    def make() -> tuple[Floats, str]:
        start, up = found.last.positions, task.target.up
        runs.append(draped(found.worn, start, body.positions, up, task.folder, progress, announce))
        return runs[0].positions(-1), f"draped for {runs[0].times[-1]:g} s"

    try:
        stage = staged("simulate", task.garment.triangles, body, make, task.on_stage)
    except InputError as error:
        return _Ended("refined", f"The drape could not begin: {error.sentence}", None, found.stages)
    run = runs[0]
    if run.status != "completed":
        return _Ended("refined", run.reason, run, found.stages)
    if not stage.counts.clean:
        reason = f"The drape ended with {stage.counts}, {stage.counts.where}."
        return _Ended("refined", reason, run, found.stages if found.last.counts.clean else (*found.stages, stage))
    fallen = _fallen(run, task.target.name)
    return _Ended("failed" if fallen else "completed", fallen or run.reason, run, (*found.stages, stage))


def _fallen(run: Run, body: str) -> str:
    """Sentence for a garment that is still falling at the end of the drape; empty where it rests on the body."""
    record = run.record()
    fastest = record[-1]["fastest"] if record else 0.0
    if fastest < FALLING:
        return ""
    return (
        f"The garment does not stay on {body}: at the end of its drape it still moves at {fastest:.2g} m/s. "
        "Does it lie on the body that it was made for (--from, --scale)?"
    )


def _write(done: Fit, seconds: float) -> None:
    """`fitted.obj`, and the stages in the summary; of a fit without a drape a summary of its own."""
    write_obj(done.directory / FITTED, done.positions, done.garment.triangles)
    file = done.directory / SUMMARY_NAME
    kept = read_summary(file) if done.run is not None else {"failure": None, "certificate": None, "notes": []}
    fitted: dict[str, Any] = {
        "status": done.status,
        "reason": done.reason,
        "stages": [stage.as_dict() for stage in done.stages],
        "cost": done.cost.as_dict(),
        "notes": [*done.notes, *kept["notes"]],
        "fit_seconds": seconds,
    }
    if done.status == "failed":
        place, counts = done.counts.place, str(done.counts)
        failed = {"cause": "fit", "sentence": done.reason, "element": counts, "position": place, "remedy": REMEDY}
        fitted["failure"] = {**failed, **dict.fromkeys(("step", "time", "dt"))}  # it failed in no step
    write_summary(file, {**kept, **fitted})


def _same_file(one: str | Path, other: str | Path) -> bool:
    return Path(one).resolve() == Path(other).resolve()


def _refuse_a_body(worn: Garment, *figures: Figure) -> None:
    for figure in figures:
        if np.array_equal(worn.positions, figure.positions):
            raise InputError(
                f"{worn.name} and {figure.name} are the same mesh: a body does not wear itself.",
                "Name the garment first, then --from and --to its bodies; --part takes some vertices of a file only.",
            )


def _make_directory(directory: Path, sources: Sequence[Path]) -> None:
    """An output directory without files of an earlier fit. InputError where one of them is among `sources`."""
    folder = directory.resolve()
    for source in sources:
        if source.resolve().parent == folder and source.name in LEFT:
            raise InputError(f"{source} would be replaced by the fit's own {source.name}.", "Choose another directory.")
    try:
        directory.mkdir(parents=True, exist_ok=True)
        for name in LEFT:
            (directory / name).unlink(missing_ok=True)
    except OSError as error:
        raise InputError(f"{directory} cannot be made a directory: {error.strerror}.", "Choose another.") from error
