"""Dress: a sewing pattern meshed, placed, closed round a body, welded and draped; checked exactly after each stage."""

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from clothsim import Cloth, Pattern, Run
from clothsim.base.errors import InputError
from clothsim.base.file_writing import make_directory
from clothsim.base.inputs import renamed
from clothsim.engine import refuse_earlier_run
from clothsim.files import read_pattern
from clothsim.garments.dress.closing import close, mean_edge, welded_where_closed, worst_gap
from clothsim.garments.dress.corrections import (
    approached,
    crossing_panels,
    lifted,
    panels_in_contact,
    separated,
    sleeves_cleared,
)
from clothsim.garments.dress.draping import drape
from clothsim.garments.dress.dressed import Dress, write_results
from clothsim.garments.dress.grading import Grading, graded
from clothsim.garments.dress.held_edges import edges_held, parts_for_edges, slid
from clothsim.garments.dress.measurements import tight_notes
from clothsim.garments.dress.placement import placed_on, refuse_unsuitable, turned_to_arms, turned_to_legs
from clothsim.garments.dress.sewing_state import Fabrics, SewingState, as_placed
from clothsim.garments.inputs import BodyMesh, as_body_mesh, read_body_mesh
from clothsim.garments.stages import Announcement, Listener, PlannedStage, Stage, StageCallback, run_stages, staged
from clothsim.patterns import TOUCHING, joined_vertices, mesh_pattern
from transfer.errors import TransferError
from transfer.signed_distance import BodySurface, body_surface

SLID = 0.07
"""Way down from the placement, as a fraction of the body's height, beyond which a note says so."""


@dataclass(frozen=True)
class DressTask:
    """What all stages share: the body and its surface, fabric, directory and listeners."""

    body: BodyMesh
    surface: BodySurface
    fabrics: Fabrics
    waistband: bool
    directory: Path
    on_stage: StageCallback
    progress: Listener | None
    announce: Announcement | None


@dataclass(frozen=True)
class DressState:
    """The garment so far; status and reason: as of `Dress`."""

    state: SewingState
    stages: tuple[Stage, ...]
    status: str = "completed"
    reason: str = ""
    notes: tuple[str, ...] = ()
    run: Run | None = None
    closing: tuple[Run, ...] = ()

    @property
    def failure(self) -> str:
        """Reason for a failure; empty while nothing failed."""
        return self.reason if self.status == "failed" else ""

    def failed(self, reason: str) -> "DressState":
        """Copy that failed for a reason; as it is for none."""
        return replace(self, status="failed", reason=reason) if reason else self


@renamed(cut_for="made_for", hold="waistband")
def dress(
    pattern: str | Path | Pattern,
    on: str | Path | Any,
    output: str | Path | None = None,
    *,
    size: float = 0.02,
    fabric: str | None = None,
    fabrics: Mapping[str, str] | None = None,
    made_for: str | Path | Any | None = None,
    grade: Mapping[str, float] | None = None,
    waistband: bool = False,
    origin: str = "auto",
    rotation_order: str = "zyx",
    seams: str | Path | None = None,
    scale: float | None = None,
    body_group: str | None = None,
    overwrite: bool = False,
    on_stage: StageCallback = lambda stage: None,
    progress: Listener | None = None,
    announce: Announcement | None = None,
) -> Dress:
    """Sew a pattern on a body and drape it.

    Parameters
    ----------
    pattern : str, Path or Pattern
        A `specification.json`, a DXF drawing, or a pattern in memory.
    on : str, Path, Body or mesh object
        The body: a mesh file, a scene whose first body it is, or a mesh in memory in metres.
    output : str or Path, optional
        Directory for the run, `garment.obj`, the pattern and the summary; None: a new temporary one.
    size : float
        Distance of neighbouring vertices [m].
    fabric : str, optional
        A named fabric; None: cotton.
    fabrics : mapping of str to str, optional
        Named fabrics of panels with one of their own, by name; `*` stands for any letters: {"*cuff*": "denim"}.
    made_for : str, Path, Body or mesh object, optional
        The body that the pattern was cut for: it is graded from its girths and lengths to those of `on`. None: as cut.
    grade : mapping of str to float, optional
        Factors by name (`grading.NAMES`) in place of those between both bodies; without `made_for` the others are 1.
    waistband : bool
        True: upper edges that would slide are taken in to the girth of the body before the drape (`held_edges`).
    origin : str
        Level y = 0 of the pattern: "floor", "waist" or "auto" (see `placement.placed_on`).
    rotation_order : str
        Order of the rotations of the panels, "zyx" or "xyz".
    seams : str or Path, optional
        TOML file with the seams and the placement of a DXF drawing; None: NAME.toml beside NAME.dxf.
    scale : float, optional
        Metres per unit of the body's file; None: from its height.
    body_group : str, optional
        Group of the body's file.
    overwrite : bool
        True: replace an earlier run in the directory.
    on_stage : callable
        Called with each `Stage` as it ends.
    progress, announce : callable, optional
        Callbacks of the drape, as in `simulate`.

    Returns
    -------
    Dress
        Its status is "completed", "sewn" or "failed".

    Raises
    ------
    InputError
        Invalid files or arguments, or a directory that holds an earlier run without `overwrite`.

    Examples
    --------
    >>> import clothsim
    >>> clothsim.dress("shirt_specification.json", on="body.obj", output="worn").status  # doctest: +SKIP
    'completed'
    """
    started = perf_counter()
    chosen = Fabrics(fabric or Cloth.fabric, fabrics or {})
    directory = _directory(output, overwrite)
    if not isinstance(pattern, str | Path | Pattern):
        raise InputError(f"pattern is of the type {type(pattern).__name__}.", "Give a file or a Pattern.")
    read = pattern if isinstance(pattern, Pattern) else read_pattern(pattern, rotation_order, seams)
    of_panels = chosen.of(read)
    name = "pattern" if isinstance(pattern, Pattern) else Path(pattern).stem
    body = read_body_mesh(on, scale=scale, group=body_group) if isinstance(on, str | Path) else as_body_mesh(on)
    refuse_unsuitable(body)
    if waistband:
        parts_for_edges(body)  # an error now, not after the closing
    grading = _graded(read, body, made_for, grade or {}, origin)
    if grading is not None:
        read, origin = grading.pattern, grading.origin
    mesh, placing_notes = placed_on(mesh_pattern(read, size), body, origin)
    joined_vertices(mesh)  # an error now, not after the closing
    surface = _surface(body)
    mesh, arm_notes = turned_to_arms(mesh, body)
    mesh, leg_notes = turned_to_legs(mesh, body, surface)
    make_directory(directory)
    task = DressTask(body, surface, chosen, waistband, directory, on_stage, progress, announce)
    begun = DressState(
        as_placed(mesh),
        (),
        notes=(
            *mesh.pattern.notes,
            *(grading.notes if grading else ()),
            *placing_notes,
            *arm_notes,
            *leg_notes,
            *body.notes,
        ),
    )
    done = run_stages(STAGES, task, begun)
    worn = Dress(
        directory,
        done.status,
        done.reason,
        read,
        begun.state,
        done.state,
        body,
        done.stages,
        done.run,
        done.notes,
        done.closing,
        of_panels,
        grading,
    )
    write_results(worn, name, size, perf_counter() - started)
    return worn


def _directory(output: str | Path | None, overwrite: bool) -> Path:
    """Output directory. InputError where it holds an earlier run."""
    if output is None:
        return Path(tempfile.mkdtemp(prefix="clothsim-dress-"))
    if not isinstance(output, str | Path):
        raise InputError(f"output is of the type {type(output).__name__}.", "Give the name of a directory.")
    directory = Path(output)
    refuse_earlier_run(directory, overwrite)
    return directory


def _graded(
    pattern: Pattern, body: BodyMesh, made_for: Any, factors: Mapping[str, float], origin: str
) -> Grading | None:
    """The pattern graded for a body; None where it is sewn as cut."""
    if made_for is None:
        return graded(pattern, body, body, origin, factors) if factors else None
    source = read_body_mesh(made_for, option="made_for") if isinstance(made_for, str | Path) else as_body_mesh(made_for)
    return graded(pattern, source, body, origin, factors)


def _surface(body: BodyMesh) -> BodySurface:
    try:
        return body_surface(body.positions, body.triangles)
    except TransferError as error:
        raise InputError(f"{body.name}: {error}") from error


def _add_stage(
    task: DressTask, done: DressState, name: str, state: SewingState, description: str, started: float
) -> DressState:
    """The garment after a stage."""
    made = lambda: (state.positions, description)  # noqa: E731
    stage = staged(name, state.triangles, task.surface, made, task.on_stage, started)
    return replace(done, state=state, stages=(*done.stages, stage))


def touching_seams(state: SewingState) -> list[int]:
    """Seams that are closed as placed, except those of panels that intersect, which must be moved apart."""
    touching = [k for k in state.open_seams if state.gaps(state.mesh.seams[k]).max(initial=0.0) < TOUCHING]
    crossing = crossing_panels(state.weld(touching))
    return [k for k in touching if not crossing & {side.panel for side in state.mesh.seams[k].stitch.sides}]


def _place(task: DressTask, done: DressState) -> DressState:
    """Panels as placed; seams that touch are welded."""
    started, state = perf_counter(), done.state
    touching = touching_seams(state)
    state = state.weld(touching)
    state, lift_note = lifted(state, task.body, task.surface)
    state, sleeve_notes = sleeves_cleared(state, task.body)
    done = replace(done, notes=(*done.notes, *([lift_note] if lift_note else []), *sleeve_notes))
    panels, seams = len(state.mesh.pattern.panels), len(state.mesh.seams)
    size = f"{panels} panels, {seams} seams, {len(state.positions):,} vertices"
    return _add_stage(task, done, "place", state, f"{size}, {len(touching)} seams touch" if touching else size, started)


def _separate(task: DressTask, done: DressState) -> DressState:
    """Panels moved apart where they intersect one another or the body."""
    started = perf_counter()
    state, description = separated(done.state, task.body, task.surface)
    done = _add_stage(task, done, "separate", state, description, started)
    counts = done.stages[-1].counts
    if counts.clean:
        return done
    names = ", ".join(panels_in_contact(state, task.surface))
    return done.failed(f"Placed panels intersect, and no way out was found: {names} ({counts}).")


def _approach(task: DressTask, done: DressState) -> DressState:
    """Panels moved toward the body."""
    started = perf_counter()
    return _add_stage(task, done, "approach", *approached(done.state, task.body, task.surface), started)


def _close(task: DressTask, done: DressState) -> DressState:
    """Seams drawn together under contact."""
    started = perf_counter()
    try:
        closing = close(done.state, task.body, task.surface, task.fabrics, task.directory, task.progress)
    except InputError as error:
        return done.failed(f"The closing could not start: {error.sentence}")
    done = _add_stage(task, done, "close", closing.state, closing.description, started)
    return replace(done.failed(closing.failure), closing=closing.runs)


def _weld(task: DressTask, done: DressState) -> DressState:
    """Seams welded; those whose weld would intersect stay springs, and are named."""
    started, state = perf_counter(), welded_where_closed(done.state, np.inf, task.surface)
    springs = [state.mesh.seams[k].name for k in state.open_seams]
    if springs:
        note = f"stay springs, as their weld would intersect: {', '.join(springs)}"
        done = replace(done, notes=(*done.notes, note))
    welded = f"{len(state.welded)} seams"
    return _add_stage(
        task, done, "weld", state, f"{welded}, {len(springs)} stay springs" if springs else welded, started
    )


def _drape(task: DressTask, done: DressState) -> DressState:
    """Drape; where it cannot start or complete, the sewn garment is the result."""
    started, held = perf_counter(), done.state
    if task.waistband:
        held, notes = edges_held(done.state, task.body)
        done = replace(done, notes=(*done.notes, *notes))
    try:
        run = drape(held, task.body, task.fabrics, task.directory, task.progress, task.announce)
    except InputError as error:
        return replace(done, status="sewn", reason=f"The drape could not start: {error.sentence}")
    if run.status != "completed":
        return replace(done, run=run, status="sewn", reason=run.reason)
    ended = f"draped for {run.times[-1]:.3g} s"
    draped = _add_stage(task, done, "drape", done.state.moved_to(run.positions(-1)), ended, started)
    draped = replace(draped, run=run)
    counts = draped.stages[-1].counts
    if not counts.clean:
        return draped.failed(f"The drape ended with {counts}, {counts.where}.")
    levels = draped.state.positions @ task.body.up
    moved = float(np.abs(levels - done.state.positions @ task.body.up).max())
    height = float(np.ptp(task.body.positions @ task.body.up))
    if moved > 0.5 * height:
        return draped.failed(f"The garment falls off {task.body.name}: it moved by {moved:.2g} m.")
    gap, name = worst_gap(draped.state)
    if gap > mean_edge(draped.state):
        return draped.failed(f"Seam {name}, held by springs, opened to {1e3 * gap:.3g} mm in the drape.")
    below = float((draped.state.mesh.positions @ task.body.up).max() - levels.max())
    if below > SLID * height:
        note = f"the top of the garment lies {1e3 * below:.0f} mm below where its pattern places it"
        draped = replace(draped, notes=(*draped.notes, note))
    at_rest = (*slid(done.state, draped.state, task.body), *tight_notes(draped.state))
    draped = replace(draped, notes=(*draped.notes, *at_rest))
    return replace(draped, reason=_closed_seams(draped.state, task.body.name))


def _closed_seams(state: SewingState, body: str) -> str:
    """What was closed, in a sentence."""
    seams, (gap, name) = len(state.mesh.seams), worst_gap(state)
    if not state.open_seams:
        return f"All {seams} seams are closed and the garment rests on {body}."
    return (
        f"{len(state.welded)} of {seams} seams are welded throughout, springs hold the rest, within {1e3 * gap:.2g} mm"
        f" ({name}); the garment rests on {body}."
    )


STAGES = (
    PlannedStage("place", _place),
    PlannedStage("separate", _separate, lambda task, done: not done.stages[-1].counts.clean),
    PlannedStage("approach", _approach, lambda task, done: bool(done.state.open_seams)),
    PlannedStage("close", _close, lambda task, done: bool(done.state.open_seams)),
    PlannedStage("weld", _weld),
    PlannedStage("drape", _drape),
)
"""Stages of dressing."""
