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
from time import process_time
from typing import NamedTuple

import numpy as np

from clothsim import Run
from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.engine import facing_away, untangle
from clothsim.garments.fit.guaranteed_path import NO_OVERLAP, Clearing, Overlap, clearings, flypapered_rows, overlaps_at
from clothsim.garments.fit.moving_body import StageSettings, draped, moved_with_body, near_body
from clothsim.garments.fit.pieces import layers_of
from clothsim.garments.fit.transfer_seed import NO_MARKERS, Size, Transferred, sized, transferred, worn_positions
from clothsim.garments.inputs import BodyMesh, Garment
from clothsim.garments.penetration import NO_ROWS, count_penetrations
from clothsim.garments.stages import (
    Announcement,
    Listener,
    PlannedStage,
    Stage,
    StageCallback,
    named_stage,
    run_stages,
    staged,
)
from clothsim.garments.waistband import loose_edge
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
    progress: called after each step of a run; announce: callback of the drape.
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
    announce: Announcement | None = None

    @cached_property
    def layers(self) -> Ints:
        """Layer of each vertex of the garment on its own body, (n,)."""
        worn_by, garment = body_surface(self.source.positions, self.source.triangles), self.garment
        return layers_of(garment.positions, garment.triangles, worn_by.closest(garment.positions).signed_distance)

    @property
    def same_body(self) -> bool:
        """True where the garment stays on its body and is only repaired."""
        return self.source is self.target


class DrapeOutcome(NamedTuple):
    """End of a drape."""

    status: str
    reason: str
    run: Run | None
    stages: tuple[Stage, ...]
    flypapered: Ints = NO_ROWS


@dataclass(frozen=True)
class FitState:
    """Garment in a fit: clean in the last of `stages` where failure is empty; worn: how the scenes wear it.

    place (n, 3) [m]: where the garment was worn, on the target; on_target: the first stage that is counted there;
    body, own_body: the target, and the body that it was made for; source_shape (k, 3) [m]: the latter in the target's
    shape; size: of the garment there; stopped_at (3,) [m]: where a motion failed; overlap: of the body with itself,
    which is open at the start of the drape; outcome: of the drape.
    """

    stages: tuple[Stage, ...]
    worn: StageSettings
    place: Floats
    on_target: int
    body: BodySurface
    own_body: BodySurface
    source_shape: Floats
    size: Size
    failure: str = ""
    notes: tuple[str, ...] = ()
    stopped_at: Floats | None = None
    overlap: Overlap = NO_OVERLAP
    outcome: DrapeOutcome | None = None

    @property
    def last(self) -> Stage:
        """Last stage."""
        return self.stages[-1]

    def with_stage(self, stage: Stage) -> "FitState":
        """Copy with one more stage."""
        return replace(self, stages=(*self.stages, stage))


def seed_fit(task: Task) -> FitState:
    """Run the stages before the drape. InputError for a garment or a body that no stage can take."""
    try:
        closed, own = task.target.closed, task.source.closed
        body = body_surface(closed.positions, closed.triangles)
        own_body = body if task.same_body else body_surface(own.positions, own.triangles)
        rest = task.garment.positions
        worn = StageSettings(task.garment, rest, task.fabric, body.triangles, self_contact=True)
        size = Size(rest, "own", rest)
        return run_stages(SEEDING, task, FitState((), worn, rest, 0, body, own_body, closed.positions, size))
    except TransferError as error:
        faults = filter(None, [task.source.fault, "" if task.same_body else task.target.fault])
        raise InputError(" ".join([*faults, error.sentence]), error.remedy) from error


def run_fit(task: Task) -> FitState:
    """Run all stages; the outcome is that of the drape, or of the stage that failed."""
    state = seed_fit(task)
    if not state.failure:
        state = run_stages(DRAPING, task, state)
    return replace(state, outcome=state.outcome or DrapeOutcome("failed", state.failure, None, state.stages))


def _lay_out(task: Task, state: FitState) -> FitState:
    """The garment on its own body, and freed of intersections with itself where it has some."""
    garment, worn_by = task.garment, state.own_body
    made = lambda: (garment.positions, f"as it lies on {task.source.name}")  # noqa: E731
    state = state.with_stage(staged("garment", garment.triangles, worn_by, made, task.on_stage))
    if state.last.counts.self_pairs:
        freed = _untangle(garment.positions, state.last, None, worn_by, task)
        state = state if freed is None else state.with_stage(freed)
    if state.last.counts.self_pairs:  # nothing later parts what cannot be parted on its own body
        return replace(state, failure=_self_intersection_reason(state.last))
    return replace(state, on_target=0 if task.same_body else len(state.stages))


def _transfer(task: Task, state: FitState) -> FitState:
    """The garment on the target, each triangle deformed as the body below it."""
    done: list[Transferred] = []

    def make() -> tuple[Floats, str]:
        shaped = replace(task.garment, positions=state.last.positions)
        done.append(transferred(shaped, task.source.closed, task.target.closed, task.markers))
        return done[0].positions, done[0].description

    stage = staged("transfer", task.garment.triangles, state.body, make, task.on_stage)
    return replace(state.with_stage(stage), source_shape=done[0].body)


def _resize(task: Task, state: FitState) -> FitState:
    """The transferred garment in its own or its graded size, and where it was worn."""
    started, garment = process_time(), task.garment
    bodies = task.source.closed, task.target.closed
    size = sized(garment, *bodies, state.last.positions, state.body, graded=task.resize)
    if size.kind != "transferred":
        made = lambda: (size.positions, str(size))  # noqa: E731
        stage = staged("size", garment.triangles, state.body, made, task.on_stage, started)
        # the transferred shape is stretched as the bodies are: none to start from
        state = replace(state.with_stage(stage), on_target=state.on_target + 1)
    worn = replace(state.worn, rest=size.rest) if task.resize else state.worn
    place = worn_positions(garment.positions, state.own_body, state.source_shape)
    return replace(state, size=size, worn=worn, place=place)


def _clear(task: Task, state: FitState) -> FitState:
    """Intersection contours with the body shrunk to nothing, at a distance from it where that can be."""
    body = state.body
    wider = replace(body, positions=body.positions + MARGIN * body.vertex_normals)
    tries = (_untangle(state.worn.rest, state.last, beside, body, task, "clear") for beside in (wider, body))
    cleared = next((stage for stage in tries if stage is not None), None)
    return state if cleared is None else state.with_stage(cleared)


def _onto_pieces(task: Task, state: FitState) -> FitState:
    """The garment on the body's own pieces, in place of the closed surface round them."""
    target = task.target
    body = body_surface(target.positions, target.triangles)
    state = replace(state, body=body, worn=replace(state.worn, body_triangles=body.triangles), overlap=NO_OVERLAP)
    where = f"on the pieces of {target.name} in place of the surface round them"
    positions = state.last.positions
    state = state.with_stage(staged("pieces", task.garment.triangles, body, lambda: (positions, where), task.on_stage))
    if not state.last.counts.clean:
        state = _clear(task, state)
    if state.last.counts.clean:
        return state
    counts = state.last.counts
    return replace(
        state, failure=f"The pieces of {target.name} reach out of the surface round them: {counts}, {counts.where}."
    )


def _refine_on_body(task: Task, state: FitState) -> FitState:
    """DRAPE refinement; for thin limbs, where the closest point may be on the wrong side, along the normals."""
    shape = state.last.positions
    for along_normals in (False, True):
        make = partial(_refine, shape, task, state.body, along_normals=along_normals)
        state = state.with_stage(staged("refine", task.garment.triangles, state.body, make, task.on_stage))
        if state.last.counts.on_body:
            break
    return state


def _refine(positions: Floats, task: Task, body: BodySurface, along_normals: bool) -> tuple[Floats, str]:
    done = refined_on(body, positions, task.garment.triangles, along_normals=along_normals)
    how = ", along the garment's normals" if along_normals else ""
    return done.positions, f"DRAPE, eps {1e3 * np.min(done.eps):.2g} to {1e3 * np.max(done.eps):.2g} mm{how}"


def _run_guaranteed_path(task: Task, state: FitState) -> FitState:
    """Deflate and grow; where no depth frees any shape, morph the one body into the other first."""
    body = state.body
    own = [stage for stage in state.stages if stage.name in ("garment", "untangle")][-1]
    done = _free_of_body(state, state.stages[state.on_target :], task, body)
    if (done is None or done.failure) and not task.same_body and own.counts.on_body:
        if done is not None:
            state = replace(state, stages=done.stages, notes=(*done.notes, done.failure))
        closed = task.source.closed
        worn = replace(state.worn, body_triangles=closed.triangles)
        frames, how = [closed.positions, state.source_shape], f"{task.source.name} became {task.target.name} under IPC"
        moved = _move_body(replace(state, worn=worn), "morph", own.positions, frames, task, state.body, how)
        state = replace(moved, worn=state.worn)
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
    started, triangles = process_time(), task.garment.triangles
    body = None if beside is None else (beside.positions, beside.triangles)
    faces = facing_away(task.garment.positions, triangles, task.source.positions, np.ones(len(triangles), bool))
    done = untangle(stage.positions, faces, rest, body=body, layers=task.layers)
    if not done.free:
        return None
    most = 1e3 * float(np.linalg.norm(done.positions - stage.positions, axis=1).max())
    description = f"{done.pairs_before} pairs parted in {done.rounds} rounds, by {most:.2g} mm at most"
    if task.layers.any():
        description += f"; {int(task.layers.max()) + 1} layers in their order"
    return staged(name, triangles, counted_on, lambda: (done.positions, description), task.on_stage, started)


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
        if run.status != "completed" or count_penetrations(positions, worn.garment.triangles, end).on_body:
            break
    if run.status == "completed":
        return MotionResult(positions, how, "", None)
    place = run.summary["failure"]["position"]
    return MotionResult(positions, how, run.reason, None if place is None else np.asarray(place, np.float64))


FALLING = 0.5
"""Largest speed at the end of a drape [m/s] for a garment that rests on the body."""


def drape_fitted(task: Task, state: FitState) -> DrapeOutcome:
    """Drape; where it cannot start or complete, its start is the result, with status refined."""
    body = state.body
    runs: list[Run] = []

    def make() -> tuple[Floats, str]:
        start, up = state.last.positions, task.target.up
        progress = named_stage("simulate", task.progress)
        worn, folder, opened = state.worn, task.folder, state.overlap.opened
        runs.append(draped(worn, start, body.positions, up, folder, progress, task.announce, opened=opened))
        return runs[0].positions(-1), f"draped for {runs[0].times[-1]:g} s"

    def flypapered() -> Ints:
        if not len(state.overlap):
            return NO_ROWS
        return flypapered_rows(state.overlap, runs[0].positions(-1), runs[0].field("carried", -1) > 0)

    try:
        stage = staged("simulate", task.garment.triangles, body, make, task.on_stage, flypapered=flypapered)
    except InputError as error:
        return DrapeOutcome("refined", f"The drape could not start: {error.sentence}", None, state.stages)
    run = runs[0]
    if run.status != "completed":
        return DrapeOutcome("refined", run.reason, run, state.stages)
    if not stage.counts.clean:
        reason = f"The drape ended with {stage.counts}, {stage.counts.where}."
        return DrapeOutcome("refined", reason, run, state.stages if state.last.counts.clean else (*state.stages, stage))
    record, fallen = run.record(), ""
    fastest = record[-1]["fastest"] if record else 0.0
    if fastest >= FALLING:
        loose = loose_edge(state.last.positions, task.garment.triangles, task.target)
        fallen = (
            f"The garment does not stay on {task.target.name}: at the end of its drape it still moves at {fastest:.2g} "
            f"m/s. {loose or 'Does it lie on the body that it was made for (--made-for, --scale)?'}"
        )
    stages = (*state.stages, stage)
    return DrapeOutcome("failed" if fallen else "completed", fallen or run.reason, run, stages, flypapered())


SEEDING = (
    PlannedStage("garment", _lay_out),
    PlannedStage("transfer", _transfer, lambda task, state: not task.same_body),
    PlannedStage("size", _resize, lambda task, state: not task.same_body),
    PlannedStage("clear", _clear, lambda task, state: bool(state.last.counts.body_pairs)),
    PlannedStage("refine", _refine_on_body, lambda task, state: not state.last.counts.clean),
    PlannedStage("grow", _run_guaranteed_path, lambda task, state: not state.last.counts.clean),
    PlannedStage("pieces", _onto_pieces, lambda task, state: task.target.closed is not task.target),
)
"""Stages before the drape; a stage that is needed may add none or several to the summary."""


def _drape(task: Task, state: FitState) -> FitState:
    return replace(state, outcome=drape_fitted(task, state))


DRAPING = (PlannedStage("simulate", _drape),)
"""The last stage."""
