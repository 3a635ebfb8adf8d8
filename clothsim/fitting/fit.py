"""`clothsim.fit`: a garment made for one body, draped and free of intersections on another."""

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
from clothsim.fitting.stage import Garment, Heard, Stage, staged
from clothsim.io.checkpoint import CHECKPOINT_NAME
from clothsim.io.obj_writer import write_obj
from clothsim.io.record import RECORD_NAME, SUMMARY_NAME, read_summary, write_summary
from clothsim.io.trajectory import TRAJECTORY_NAME
from clothsim.run.recorded_run import Announcement, Listener
from clothsim.run.results import Run
from clothsim.run.resume import FITTED
from clothsim.scene.fabrics import fabric_named
from transfer.signed_distance import body_surface

LEFT = (SUMMARY_NAME, RECORD_NAME, TRAJECTORY_NAME, CHECKPOINT_NAME, FITTED, REST, START, BODY)
"""What a fit leaves in its directory."""
REMEDY = "Look at fit.png, and at the garment on its own body: `clothsim check GARMENT --on BODY -o FILE`."
FALLING = 0.5
"""A garment that is faster than that at the end of its drape [m/s] is not settling."""


@dataclass(frozen=True)
class Fit:
    """What a fit left in `directory`.

    status: "completed" (simulated to its end), "refined" (the garment is free of intersections, but its simulation
    could not go on), or "failed"; reason: a sentence; stages: what was tried, in order; run: the drape, or None where
    none was started; cost: what it did to the garment.
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
        """The fitted garment, (n, 3) [m]."""
        return self.stages[-1].positions

    @property
    def counts(self) -> Counts:
        """What is wrong with the fitted garment by the exact test: nothing, unless the fit failed."""
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
    heard: Heard = lambda stage: None,
    progress: Listener | None = None,
    announce: Announcement | None = None,
) -> Fit:
    """Fit the `garment` made for one body (a mesh file, MakeHuman clothes, or a scene's cloth) onto the body `to`.

    made_for: the body that it lies on; None: `to` itself, on which it is repaired. scale: metres per unit of the
    garment and of that body (None: as the body's height tells). body_group: a group of the body files. part: (lo, hi),
    these vertices of the garment's file. weld: borders closer than that are sewn [m]. A scene says all this itself, but
    for body_group of `to`. resize: the garment is made anew in the other body's size; False: its own rest shape stays.
    markers: a file of places on both bodies that mean the same (None: derived where their meshes differ).
    Leaves in `output` (None: a fresh temporary folder) what a run leaves, `fitted.obj`, and the stages in the summary;
    files of an earlier fit there are removed. InputError for bad input.
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
    task = Task(worn, source, target, fabric, resize, directory, heard, places)
    found = seeded(task)
    return _simulated(task, found, started, progress, announce)


def _simulated(
    task: Task, found: Seeded, started: float, progress: Listener | None, announce: Announcement | None
) -> Fit:
    """The drape, and what is left of it."""
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
    """How a drape ended."""

    status: str
    reason: str
    run: Run | None
    stages: tuple[Stage, ...]


def _draped(task: Task, found: Seeded, progress: Listener | None, announce: Announcement | None) -> _Ended:
    """The drape; where it cannot begin or go on, what it started from is the answer, and is called refined."""
    body = body_surface(task.target.positions, task.target.triangles)
    runs: list[Run] = []

    def make() -> tuple[Floats, str]:
        start, up = found.last.positions, task.target.up
        runs.append(draped(found.worn, start, body.positions, up, task.folder, progress, announce))
        return runs[0].positions(-1), f"draped for {runs[0].times[-1]:g} s"

    try:
        stage = staged("simulate", task.garment.triangles, body, make, task.heard)
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
    """A sentence where the garment is still falling when the drape ends: it does not lie on the body."""
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
