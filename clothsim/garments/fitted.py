"""Fit of a garment to another body: transfer, repair and drape."""

import tempfile
import warnings
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from clothsim import Body, Cloth, Run
from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.base.file_writing import write_atomically
from clothsim.base.inputs import refuse_uncallable, with_remedies
from clothsim.base.process_memory import Stopwatch
from clothsim.base.record import FITTED_NAME, RECORD_NAME, SUMMARY_NAME, read_summary, write_summary
from clothsim.engine import example_file, fabric_named, refuse_earlier_run
from clothsim.files import CHECKPOINT_NAME, TRAJECTORY_NAME, write_obj
from clothsim.garments.fit.moving_body import BODY, CLOSING, REST, START
from clothsim.garments.fit.pipeline import FitState, Task, run_fit
from clothsim.garments.fit.transfer_seed import NO_MARKERS, Size, read_markers
from clothsim.garments.fit.wear_check import Distortion, WearCheck, check_wear, cost_of
from clothsim.garments.inputs import (
    BODY_FILE,
    BodyMesh,
    Garment,
    as_body_mesh,
    fitted_text,
    garment_of,
    read_body_mesh,
    read_garment,
    worn_in_scene,
)
from clothsim.garments.penetration import NO_ROWS, Counts
from clothsim.garments.stages import Announcement, Listener, Stage, StageCallback, best_stage
from clothsim.garments.tightness import Tightness, parts_on_body, tight_entries, tight_notes, tight_parts_of_run
from transfer.body_frame import legs_score
from transfer.errors import TransferError

LEFT = (SUMMARY_NAME, RECORD_NAME, TRAJECTORY_NAME, CHECKPOINT_NAME, FITTED_NAME, REST, START, BODY, *CLOSING)
"""Files of a fit in its directory."""
REMEDY = "Check fit.png, and the garment on its own body: `clothsim check GARMENT --on BODY -o FILE`."


@dataclass(frozen=True)
class Fit:
    """Result of `fit`.

    Attributes
    ----------
    directory : Path
        Output directory.
    status : str
        "completed" (simulated to its end), "distorted" (so, but it does not look worn: see `look`), "refined" (the
        garment is free of intersections, but its simulation did not
        complete) or "failed".
    reason : str
        Reason for the status, one sentence.
    garment : Garment
        Garment as given.
    source, target : BodyMesh
        Body that the garment was made for, and body that it is fitted to.
    stages : tuple of Stage
        Stages in order, each with positions and penetration counts.
    answer : Stage
        The resulting stage: the last, or for a failed fit the one with the fewest intersections on the target.
    run : Run or None
        Drape; None if none was started.
    cost : Distortion
        Stretches and displacement of the garment.
    size : Size
        Whether the garment is graded, and its factors of girths and lengths.
    look : WearCheck
        Checks of whether the garment looks worn, and the fault if it does not.
    notes : tuple of str
        Defaults used in reading and fitting.
    flypapered : (k,) int array
        Rows of `positions` that the body carries where it overlaps itself, as thighs do: their intersections are left
        out of `counts`. Empty on all other bodies.
    tight : mapping of str to Tightness
        Parts of the body on which the garment is too tight, with stretch, pressure and ease; empty without a drape.

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
    source: BodyMesh
    target: BodyMesh
    stages: tuple[Stage, ...]
    answer: Stage
    run: Run | None
    cost: Distortion
    size: Size
    look: WearCheck
    notes: tuple[str, ...]
    flypapered: Ints = field(default_factory=lambda: NO_ROWS)
    tight: Mapping[str, Tightness] = field(default_factory=dict)

    @property
    def carried(self) -> Ints:
        """Earlier name of `flypapered`."""
        warnings.warn("carried is now flypapered.", DeprecationWarning, stacklevel=2)
        return self.flypapered

    @property
    def answer_number(self) -> int:
        """Number of the resulting stage, from 0."""
        return next(number for number, stage in enumerate(self.stages) if stage is self.answer)

    @property
    def positions(self) -> Floats:
        """Positions of the simulated pieces of the fitted garment, (n, 3) [m]."""
        return self.answer.positions

    @property
    def complete_positions(self) -> Floats:
        """Positions of all vertices of the garment's file, including pieces that follow others [m]."""
        return self.garment.division.complete(self.positions)

    @property
    def counts(self) -> Counts:
        """Penetration counts of the fitted garment by the exact check; clean unless the fit failed."""
        return self.answer.counts


@with_remedies()
def fit(
    garment: str | Path | Cloth | Any,
    to: str | Path | Body | Any,
    made_for: str | Path | Body | Any = None,
    output: str | Path | None = None,
    *,
    scale: float | None = None,
    scale_to: float | None = None,
    body_group: str | Sequence[str] | None = None,
    part: tuple[int, int] | None = None,
    weld: float = 0.0,
    fabric: str | None = None,
    resize: bool = True,
    markers: str | Path | None = None,
    on_stage: StageCallback = lambda stage: None,
    progress: Listener | None = None,
    announce: Announcement | None = None,
    overwrite: bool = False,
) -> Fit:
    """Fit a garment made for one body to another body.

    The output directory contains the files of a run, `fitted.obj`, and the stages in summary.json.

    Parameters
    ----------
    garment : str, Path, Cloth or mesh object
        A mesh file, MakeHuman clothes (.mhclo), a scene (its first cloth), or a mesh in memory in metres.
    to : str, Path, Body or mesh object
        The body that will wear it.
    made_for : str, Path, Body or mesh object, optional
        The body that the garment was made for; None: `to`, on which it is repaired. Not needed for a scene.
    output : str or Path, optional
        Directory for the files of a run and `fitted.obj`; None: a new temporary one.
    scale : float, optional
        Metres per unit of the files of garment and body; None: from the height of the body.
    scale_to : float, optional
        Metres per unit of the file of the target body; None: from its height, or `scale` if both bodies are the same.
    body_group : str or sequence of str, optional
        Group of the body files.
    part : (lo, hi), optional
        Vertices of the garment's file.
    weld : float
        Borders closer than this are sewn together [m].
    fabric : str, optional
        A named fabric; None: that of the `clothsim.Cloth`, else cotton.
    resize : bool
        True: grade the garment along the girths and lengths of the bodies; False: leave its size as cut.
    markers : str or Path, optional
        File of corresponding points, six numbers per line; None: derived if the meshes of the bodies differ.
    on_stage : callable
        Called with each `Stage` as it ends.
    progress : callable, optional
        Called after each step of a stage that is a run (grow, morph, simulate), with its name in `Progress.stage`.
    announce : callable, optional
        Callback of the drape, as in `simulate`.
    overwrite : bool
        True: replace an earlier run or fit in `output`.

    Returns
    -------
    Fit
        Its status is "completed", "distorted", "refined" or "failed".

    Raises
    ------
    InputError
        Invalid files or arguments, or a directory that holds an earlier run without `overwrite`.

    Examples
    --------
    >>> import clothsim
    >>> clothsim.fit("shirt.obj", "tall.obj", made_for="small.obj").status  # doctest: +SKIP
    'completed'
    >>> clothsim.fit("shirt.obj", "tall.obj", output="out", fabric="paper")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    clothsim.base.errors.InputError: ...
    """
    refuse_uncallable(on_stage=on_stage, progress=progress, announce=announce)
    watch = Stopwatch()
    garment = example_file(garment, what="the mesh file of the garment, or a scene with it")
    to, made_for = (example_file(body, what=BODY_FILE) for body in (to, made_for))
    directory = Path(tempfile.mkdtemp(prefix="clothsim-fit-") if output is None else output)
    refuse_earlier_run(directory, overwrite, LEFT, (garment, to, made_for, markers))
    named = fabric or (garment.fabric if isinstance(garment, Cloth) else Cloth.fabric)
    fabric_named("fabric", named)
    base = to if made_for is None else made_for
    of_scene = isinstance(garment, str | Path) and Path(garment).suffix.lower() == ".toml"
    if not isinstance(garment, str | Path):
        if scale is not None or part is not None:
            raise InputError("scale and part are for the file of a garment.", "Give clothsim.Cloth(..., scale=...).")
        source = _read_body(base, None, body_group)
        worn = garment_of(garment, weld)
    elif of_scene:
        if made_for is not None or scale is not None or part is not None or weld:
            raise InputError(
                f"{garment} is a scene: its body, unit, part and seams are its own.",
                "Leave --made-for, --scale, --part and --weld out, or give the garment's file.",
            )
        worn, source = worn_in_scene(garment)
        base = garment
    else:
        source = _read_body(base, scale, body_group)
        file = base if isinstance(base, str | Path) else None
        worn = read_garment(garment, file, source.scale, part=part, weld=weld, body=source.positions)
    in_files = isinstance(base, str | Path) and isinstance(to, str | Path)
    same = Path(base).resolve() == Path(to).resolve() if in_files else base is to
    target = source if same and scale_to in (None, scale) else _target(to, scale_to, body_group)
    for body in () if of_scene else (source, target):
        if np.array_equal(worn.positions, body.positions):
            raise InputError(
                f"{worn.name} and {body.name} are the same mesh: a body does not wear itself.",
                "Name the garment first, then its bodies by --made-for and --to; --part takes some vertices of a file.",
            )
    for body in (target,) if source is target else (target, source):
        refuse_lying(body)
    placed_markers = NO_MARKERS if markers is None else read_markers(markers)
    try:
        directory.mkdir(parents=True, exist_ok=True)
        for name in LEFT:
            (directory / name).unlink(missing_ok=True)
    except OSError as error:
        raise InputError(f"{directory} cannot be made a directory: {error.strerror}.", "Choose another.") from error
    task = Task(worn, source, target, named, resize, directory, on_stage, placed_markers, progress, announce)
    return _finish_fit(task, run_fit(task), watch)


def _read_body(body: Any, scale: float | None, group: str | Sequence[str] | None) -> BodyMesh:
    """A body from a file or from memory."""
    return read_body_mesh(body, scale=scale, group=group) if isinstance(body, str | Path) else as_body_mesh(body)


def _target(body: Any, scale: float | None, group: str | Sequence[str] | None) -> BodyMesh:
    """The body that shall wear the garment. InputError for a unit of what has its own."""
    in_file = isinstance(body, str | Path)
    if scale is not None and (not in_file or Path(body).suffix.lower() == ".toml"):
        raise InputError(
            "scale_to is for the mesh file of a body: a scene and a mesh in memory are in metres.",
            "Leave --scale-to out.",
        )
    return read_body_mesh(body, scale=scale, group=group, option="--scale-to") if in_file else as_body_mesh(body)


def _finish_fit(task: Task, state: FitState, watch: Stopwatch) -> Fit:
    """Check the fitted garment and write the results."""
    assert state.outcome is not None
    status, reason, run, stages, flypapered = state.outcome
    if not stages[-1].counts.clean:  # self_contact was off, or nothing freed it
        status = "failed"
    answer = stages[-1] if status != "failed" else stages[best_stage(stages, state.on_target)]
    look = check_wear(task.garment, answer.positions, task.source, task.target)
    if status == "completed" and look.fault:
        status, reason = "distorted", f"The garment is intersection-free, but {look.fault}."
    tight = tight_parts_of_run(run, parts_on_body(run, task.target)) if run and status == "completed" else {}
    done = Fit(
        task.folder,
        status,
        reason,
        task.garment,
        task.source,
        task.target,
        stages,
        answer,
        run,
        cost_of(task.garment, answer.positions, state.place),
        state.size,
        look,
        (
            *task.garment.notes,
            *task.source.notes,
            *(() if task.same_body else task.target.notes),
            *state.notes,
            *tight_notes(tight),
        ),
        flypapered if answer is stages[-1] else NO_ROWS,
        tight,
    )
    _write(done, watch)
    return done


def _write(done: Fit, watch: Stopwatch) -> None:
    """`fitted.obj`, and the stages in the summary; of a fit without a drape a summary of its own."""
    division, positions = done.garment.division, done.complete_positions
    whole = division.whole if division.embedded else done.garment.triangles
    text = fitted_text(done.garment.original, positions)
    if text:
        write_atomically(done.directory / FITTED_NAME, text.encode())
    else:
        write_obj(done.directory / FITTED_NAME, positions, whole)
    file = done.directory / SUMMARY_NAME
    previous = read_summary(file) if done.run is not None else {"failure": None, "certificate": None, "notes": []}
    fitted: dict[str, Any] = {
        "status": done.status,
        "reason": done.reason,
        "stages": [stage.as_dict() for stage in done.stages],
        "fitted_stage": done.answer_number,
        "cost": done.cost.as_dict(),
        "size": done.size.as_dict(),
        "look": done.look.as_dict(),
        "tight": tight_entries(done.tight),
        "notes": [*done.notes, *previous["notes"]],
        "pieces": division.as_dict(),
        "fit_seconds": watch.wall_seconds(),
        "cpu_seconds": watch.cpu_seconds(),
    }
    if len(done.flypapered):
        middle = done.positions[done.flypapered].mean(axis=0).tolist()
        fitted["carried"] = {"vertices": done.flypapered.tolist(), "position": middle}
    if done.status in ("failed", "distorted"):
        position, counts = done.counts.position, str(done.counts)
        if done.status == "distorted":
            position, counts = np.asarray(done.look.place), done.look.fault
        failed = {"cause": "fit", "sentence": done.reason, "element": counts, "position": position, "remedy": REMEDY}
        fitted["failure"] = {**failed, **dict.fromkeys(("step", "time", "dt"))}  # it failed in no step
    write_summary(file, {**previous, **fitted})


STANDS = 0.5
"""Least score of legs and head along an axis, as in `body_frame`."""
CLEARLY = 0.8
"""Least score with which a body is refused: what has no legs and head (a torso, a hand, a ball) is none of them."""
OTHERS = {"+x": (1, 0, 0), "-x": (-1, 0, 0), "-y": (0, -1, 0), "-z": (0, 0, -1)}
"""Directions from legs to head in which no body stands."""


def refuse_lying(body: BodyMesh) -> None:
    """InputError for a body whose legs and head are clearly along x, -y or -z, and not along y or z."""

    def score(axis: tuple[int, int, int]) -> float:
        return legs_score(body.closed.positions, body.closed.triangles, np.array(axis, np.float64))

    with suppress(TransferError):
        _ = body.frame  # computed once for the whole fit
        return
    if max(score((0, 1, 0)), score((0, 0, 1))) >= STANDS:  # no feet, say
        return
    lies = [name for name, axis in OTHERS.items() if score(axis) >= CLEARLY]
    if lies:
        raise InputError(
            f"the body {body.name} does not stand: from legs to head it is along {lies[0]}, gravity along -y or -z.",
            "Turn it so that its head is along y or z.",
        )
