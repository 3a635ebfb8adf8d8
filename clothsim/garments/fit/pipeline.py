"""Stages of a fit: transfer, untangling, DRAPE refinement, guaranteed path, drape; each checked exactly.

Deformation transfer seeds; where its shape crosses the body, their intersection contours are shrunk to nothing, with
those of the garment; where that fails, or all of it is inside, DRAPE refines it; where that is not clear either, the
body is deflated until the better of the two is clear of it, and grows back under IPC; where no depth frees it, the body
that the garment was made for deforms into the other one under IPC and moves the garment by contact.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

import numpy as np

from clothsim import Run
from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.engine import Announcement, Listener, facing_away, untangle
from clothsim.garments.body_overlap import NO_OVERLAP, Overlap, carried_rows, overlaps_at
from clothsim.garments.fit.guaranteed_path import Clearing, clearings
from clothsim.garments.fit.moving_body import StageSettings, draped, moved_with_body, named_stage, near_body
from clothsim.garments.fit.pieces import layers_of
from clothsim.garments.fit.transfer_seed import NO_MARKERS, Size, Transferred, sized, transferred, worn_positions
from clothsim.garments.inputs import BodyMesh
from clothsim.garments.penetration import NO_ROWS, counted
from clothsim.garments.stages import Garment, Stage, StageCallback, staged
from transfer.errors import TransferError
from transfer.refine import refined_on
from transfer.signed_distance import BodySurface, body_surface

MARGIN = 0.002
"""Distance from the body to which a garment that crosses it is cleared, where that can be [m]: contact pushes below."""


@dataclass(frozen=True)
class Task:
    """A fit: garment, the body that it was made for, the one that it shall be worn by (the same: it is only repaired).

    resize: True where the rest shape is the transferred one, False where it is the given one;
    folder: where the guaranteed path leaves its runs; on_stage: called after each stage; markers (k, 6): see `markers`;
    progress: called after each step of a run.
    """

    garment: Garment
    source: BodyMesh
    target: BodyMesh
    fabric: str
    resize: bool
    folder: Path
    on_stage: StageCallback
    markers: Floats = field(default_factory=lambda: NO_MARKERS)
    progress: Listener | None = None

    @cached_property
    def layers(self) -> Ints:
        """Layer of each vertex of the garment on its own body, (n,)."""
        worn_by, garment = body_surface(self.source.positions, self.source.triangles), self.garment
        return layers_of(garment.positions, garment.triangles, worn_by.closest(garment.positions).signed_distance)

    @property
    def same_body(self) -> bool:
        """True where the garment stays on its body and is only repaired."""
        return self.source is self.target


@dataclass(frozen=True)
class FitState:
    """Start of a simulation: the last of `stages` where failure is empty; worn: how the scenes wear it.

    place (n, 3) [m]: where the garment was worn, on the target; on_target: the first stage that is counted there;
    body: the target; size: of the garment there; stopped_at (3,) [m]: where a motion failed; overlap: of the body with
    itself, which is open at the start of the drape.
    """

    stages: tuple[Stage, ...]
    worn: StageSettings
    place: Floats
    on_target: int
    body: BodySurface
    size: Size
    failure: str = ""
    notes: tuple[str, ...] = ()
    stopped_at: Floats | None = None
    overlap: Overlap = NO_OVERLAP

    @property
    def last(self) -> Stage:
        """Last stage."""
        return self.stages[-1]

    def with_stage(self, stage: Stage) -> "FitState":
        """Copy with one more stage."""
        return replace(self, stages=(*self.stages, stage))


def seed_fit(task: Task) -> FitState:
    """Run the stages until one is clean. InputError for a garment or a body that no stage can take."""
    try:
        body = body_surface(task.target.positions, task.target.triangles)
        worn_by = body if task.same_body else body_surface(task.source.positions, task.source.triangles)
        stages = _first_stages(task, worn_by)
        on_target = 0 if task.same_body else len(stages)
        carrier, rest, place = task.target.positions, task.garment.positions, task.garment.positions
        size = Size(rest, "own", rest)
        if stages[-1].counts.self_pairs:  # nothing later parts what cannot be parted on its own body
            worn = StageSettings(task.garment, rest, task.fabric, body.triangles, self_contact=True)
            return FitState(tuple(stages), worn, place, 0, body, size, _self_intersection_reason(stages[-1]))
        came = partial(staged, triangles=task.garment.triangles, on_stage=task.on_stage)
        if not task.same_body:
            moved: list[Transferred] = []
            stages.append(came("transfer", body=body, make=partial(_transfer, stages[-1].positions, task, moved)))
            carrier = moved[0].body
            started, shape = perf_counter(), stages[-1].positions
            size = sized(task.garment, task.source, task.target, shape, body, graded=task.resize)
            if size.kind != "transferred":
                stages.append(came("size", body=body, make=partial(_described, size), started=started))
                on_target += 1  # the transferred shape is stretched as the bodies are: none to start from
            rest = size.rest if task.resize else rest
            place = worn_positions(task.garment.positions, worn_by, carrier)
        if stages[-1].counts.body_pairs:
            wider = replace(body, positions=body.positions + MARGIN * body.vertex_normals)
            tries = (_untangle(rest, stages[-1], beside, body, task, "clear") for beside in (wider, body))
            cleared = next((stage for stage in tries if stage is not None), None)
            stages += [] if cleared is None else [cleared]
        if not stages[-1].counts.clean:
            shape = stages[-1].positions
            stages.append(came("refine", body=body, make=partial(_refine, shape, task, body, along_normals=False)))
            if not stages[-1].counts.on_body:  # thin limbs: the closest point may be on the wrong side
                stages.append(came("refine", body=body, make=partial(_refine, shape, task, body, along_normals=True)))
    except TransferError as error:
        raise InputError(error.sentence, error.remedy) from error
    worn = StageSettings(task.garment, rest, task.fabric, body.triangles, self_contact=True)
    state = FitState(tuple(stages), worn, place, on_target, body, size)
    return state if state.last.counts.clean else _run_guaranteed_path(state, task, body, carrier)


def _first_stages(task: Task, worn_by: BodySurface) -> list[Stage]:
    """The garment on its own body, and freed of intersections with itself where it has some."""
    garment, description = task.garment, f"as it lies on {task.source.name}"
    stages = [staged("garment", garment.triangles, worn_by, lambda: (garment.positions, description), task.on_stage)]
    freed = _untangle(garment.positions, stages[0], None, worn_by, task) if stages[0].counts.self_pairs else None
    return stages if freed is None else [*stages, freed]


def _transfer(shape: Floats, task: Task, moved: list[Transferred]) -> tuple[Floats, str]:
    moved.append(transferred(replace(task.garment, positions=shape), task.source, task.target, task.markers))
    return moved[0].positions, moved[0].description


def _described(size: Size) -> tuple[Floats, str]:
    return size.positions, str(size)


def _refine(positions: Floats, task: Task, body: BodySurface, along_normals: bool) -> tuple[Floats, str]:
    done = refined_on(body, positions, task.garment.triangles, along_normals=along_normals)
    how = ", along the garment's normals" if along_normals else ""
    return done.positions, f"DRAPE, eps {1e3 * np.min(done.eps):.2g} to {1e3 * np.max(done.eps):.2g} mm{how}"


def _run_guaranteed_path(state: FitState, task: Task, body: BodySurface, carrier: Floats) -> FitState:
    """Deflate and grow; where no depth frees any shape, morph the one body into the other first."""
    own = [stage for stage in state.stages if stage.name in ("garment", "untangle")][-1]
    done = _free_of_body(state, state.stages[state.on_target :], task, body)
    if (done is None or done.failure) and not task.same_body and own.counts.on_body:
        if done is not None:
            state = replace(state, stages=done.stages, notes=(*done.notes, done.failure))
        state = _morph_body(state, own, task, body, carrier)
        if state.failure or state.last.counts.clean:
            return state
        done = _free_of_body(state, [state.last], task, body)
    if done is None:
        counts = state.last.counts
        description = f"No deflation of {task.target.name} frees the garment: {counts}, worst {counts.where}."
        return replace(state, failure=description)
    return done


def _free_of_body(state: FitState, tried: Sequence[Stage], task: Task, body: BodySurface) -> FitState | None:
    """The shape of one of the stages `tried`, clear of the body and, where that can be had, of itself.

    The shape with the fewest intersections with itself comes first: they are harder to mend than those with the body.
    Where a growth fails the next start is tried. None where no depth frees any.
    """
    clear: list[tuple[Stage, Clearing]] = []
    failed = None
    latest_first = list(reversed(tried))  # of equals the latest
    for stage in sorted(latest_first, key=lambda stage: stage.counts.self_pairs):
        for start in clearings(stage.positions, task.garment.triangles, body):
            clear.append((stage, start))
            freed: Stage | None = stage
            if stage.counts.self_pairs:
                thin = body_surface(start.body, body.triangles)
                freed = _untangle(state.worn.rest, stage, thin, thin, task)
            if freed is None:
                continue
            before = state if freed is stage else state.with_stage(freed)
            grown = _grow_body(before, stage, start, freed.positions, task, body)
            if not grown.failure:
                return grown
            failed = grown
            note = f"Tried {start.description or 'as it is'}: {grown.failure}"
            state = replace(grown, failure="", notes=(*state.notes, note))
    if not clear:
        return None
    if failed is not None:
        return failed
    stage = min((stage for stage, _ in clear), key=lambda one: one.counts.self_pairs)
    return replace(state, failure=_self_intersection_reason(stage))


def _self_intersection_reason(stage: Stage) -> str:
    """Sentence for a garment that cannot be untangled: a drape would end as it began."""
    return (
        f"The garment intersects itself in {stage.counts.self_pairs:,} triangle pairs after the stage {stage.name}, "
        f"{stage.counts.where}, and could not be untangled."
    )


def _untangle(
    rest: Floats,
    stage: Stage,
    beside: BodySurface | None,
    counted_on: BodySurface,
    task: Task,
    name: str = "untangle",
) -> Stage | None:
    """The shape of a stage freed of intersections with itself and with the body `beside`; None where that fails."""
    started, triangles = perf_counter(), task.garment.triangles
    body = None if beside is None else (beside.positions, beside.triangles)
    faces = facing_away(task.garment.positions, triangles, task.source.positions, np.ones(len(triangles), bool))
    done = untangle(stage.positions, faces, rest, body=body, layers=task.layers)
    if not done.free:
        return None
    most = 1e3 * float(np.linalg.norm(done.positions - stage.positions, axis=1).max())
    said = f"{done.pairs_before} pairs parted in {done.rounds} rounds, by {most:.2g} mm at most"
    if task.layers.any():
        said += f"; {int(task.layers.max()) + 1} layers in their order"
    return staged(name, triangles, counted_on, lambda: (done.positions, said), task.on_stage, started)


def _grow_body(
    state: FitState, stage: Stage, start: Clearing, shape: Floats, task: Task, body: BodySurface
) -> FitState:
    """The thin body grows back to its size as a moving obstacle; nothing to do where it is not thinner."""
    if len(start.frames) == 1:
        return state if state.last.positions is shape else state.with_stage(replace(stage, seconds=0.0))
    description = f"the body {start.description}, from {stage.name}, grown back under IPC"
    grown = _move_body(state, "grow", shape, start.frames, task, body, description)
    if not grown.failure or grown.stopped_at is None:
        return grown
    for overlap in overlaps_at(body, grown.stopped_at):
        how = f"{description}, open by {1e3 * overlap.depth:.3g} mm where it overlaps itself"
        notes = (*grown.notes, f"Tried {start.description}: {grown.failure}")
        frames = (*start.frames[:-1], overlap.opened)
        before, end = replace(grown, failure="", notes=notes), body_surface(overlap.opened, body.triangles)
        opened = _move_body(before, "grow", shape, frames, task, body, how, end)
        if not opened.failure:
            return replace(opened, overlap=overlap)
    return grown


def _morph_body(state: FitState, start: Stage, task: Task, body: BodySurface, carrier: Floats) -> FitState:
    """The source body becomes the target, with the garment of the stage `start` on it."""
    worn = replace(state.worn, body_triangles=task.source.triangles)
    description = f"{task.source.name} became {task.target.name} under IPC"
    frames = [task.source.positions, carrier]
    done = _move_body(replace(state, worn=worn), "morph", start.positions, frames, task, body, description)
    return replace(done, worn=state.worn)


def _move_body(
    state: FitState,
    name: str,
    shape: Floats,
    frames: Sequence[Floats],
    task: Task,
    body: BodySurface,
    description: str,
    end: BodySurface | None = None,
) -> FitState:
    """Move a body through `frames` under the garment; end: the body there, where it is not yet `body`."""
    folder, ended = task.folder / name, []
    places: list[Floats | None] = []

    def make() -> tuple[Floats, str]:
        moved = _move_through_frames(state.worn, shape, frames, folder, named_stage(name, task.progress), end or body)
        ended.append(moved.failure)
        places.append(moved.place)
        return moved.positions, f"{description}{moved.how}"

    try:
        stage = staged(name, task.garment.triangles, body, make, task.on_stage)
    except InputError as error:
        return replace(state, failure=f"The stage {name} could not start: {error.sentence}")
    failure = ended[0] and f"In the stage {name}: {ended[0]}"
    return replace(state.with_stage(stage), failure=failure, stopped_at=places[-1])


class MotionResult(NamedTuple):
    """Shape after the motion of a body, what was changed for it, failure of the run, and its place [m]."""

    positions: Floats
    how: str
    failure: str
    place: Floats | None


def _move_through_frames(
    worn: StageSettings,
    shape: Floats,
    frames: Sequence[Floats],
    folder: Path,
    listener: Listener | None,
    end: BodySurface,
) -> MotionResult:
    """Move the body through `frames` under the garment.

    First with the part of the body near the garment: the check of the stage has the whole one. Where the garment is not
    clear of that, as it left the part, the whole body moves. What fails with friction is tried without.
    """
    whole = (tuple(frames), worn.body_triangles)
    near = near_body(shape, frames, worn.body_triangles)
    bodies = [near, whole] if len(near[1]) < len(worn.body_triangles) else [whole]
    for moved, triangles in bodies:
        run = moved_with_body(replace(worn, body_triangles=triangles), shape, moved, folder, listener)
        how = ""
        if run.status != "completed":
            run = moved_with_body(replace(worn, body_triangles=triangles), shape, moved, folder, listener, slips=True)
            how = ", without friction"
        positions = run.positions(-1)
        if run.status != "completed" or counted(positions, worn.garment.triangles, end).on_body:
            break
    if run.status == "completed":
        return MotionResult(positions, how, "", None)
    place = run.summary["failure"]["position"]
    return MotionResult(positions, how, run.reason, None if place is None else np.asarray(place, np.float64))


FALLING = 0.5
"""Largest speed at the end of a drape [m/s] for a garment that rests on the body."""


class DrapeOutcome(NamedTuple):
    """End of a drape."""

    status: str
    reason: str
    run: Run | None
    stages: tuple[Stage, ...]
    carried: Ints = NO_ROWS


def drape_fitted(task: Task, state: FitState, announce: Announcement | None) -> DrapeOutcome:
    """Drape; where it cannot start or complete, its start is the result, with status refined."""
    body = state.body
    runs: list[Run] = []

    def make() -> tuple[Floats, str]:
        start, up = state.last.positions, task.target.up
        progress = named_stage("simulate", task.progress)
        worn, folder, opened = state.worn, task.folder, state.overlap.opened
        runs.append(draped(worn, start, body.positions, up, folder, progress, announce, opened=opened))
        return runs[0].positions(-1), f"draped for {runs[0].times[-1]:g} s"

    def carried() -> Ints:
        if not len(state.overlap):
            return NO_ROWS
        return carried_rows(state.overlap, runs[0].positions(-1), runs[0].field("carried", -1) > 0)

    try:
        stage = staged("simulate", task.garment.triangles, body, make, task.on_stage, carried=carried)
    except InputError as error:
        return DrapeOutcome("refined", f"The drape could not start: {error.sentence}", None, state.stages)
    run = runs[0]
    if run.status != "completed":
        return DrapeOutcome("refined", run.reason, run, state.stages)
    if not stage.counts.clean:
        reason = f"The drape ended with {stage.counts}, {stage.counts.where}."
        return DrapeOutcome("refined", reason, run, state.stages if state.last.counts.clean else (*state.stages, stage))
    fallen = _falling_reason(run, task.target.name)
    stages = (*state.stages, stage)
    return DrapeOutcome("failed" if fallen else "completed", fallen or run.reason, run, stages, carried())


def _falling_reason(run: Run, body: str) -> str:
    """Sentence for a garment that is still falling at the end of the drape; empty where it rests on the body."""
    record = run.record()
    fastest = record[-1]["fastest"] if record else 0.0
    if fastest < FALLING:
        return ""
    return (
        f"The garment does not stay on {body}: at the end of its drape it still moves at {fastest:.2g} m/s. "
        "Does it lie on the body that it was made for (--from, --scale)?"
    )
