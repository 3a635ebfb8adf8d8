"""Stages of dressing: panels placed, moved apart, toward the body, their seams closed and welded, the garment draped.

Friction holds the folds and strains that the closing left. A garment that hangs on the shoulders is therefore shaken
down first, with little friction, as a person pulls a shirt straight. What is in equilibrium with it is so with more,
as the forces that more friction can give include those of less.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from clothsim import Body, Run
from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.base.text import length_text
from clothsim.garments.dress.closing import close, torso
from clothsim.garments.dress.corrections import (
    approached,
    lifted,
    panels_in_contact,
    parted,
    separated,
    sleeves_cleared,
    touching_seams,
)
from clothsim.garments.dress.limbs import Wearer
from clothsim.garments.dress.placement import CHEST, hangs_on_shoulders, surrounds
from clothsim.garments.dress.rings import centred, closed_round_legs
from clothsim.garments.dress.sewing_state import (
    Fabrics,
    SewingState,
    mean_edge,
    sewn_cloth,
    welded_and_untangled,
    welded_where_closed,
    worst_gap,
)
from clothsim.garments.fit.moving_body import carrying_stiffness
from clothsim.garments.inputs import BodyMesh
from clothsim.garments.stages import (
    MOTION_SECONDS,
    Announcement,
    Listener,
    PlannedStage,
    Stage,
    StageCallback,
    dress_drape,
    fit_motion,
    named_stage,
    simulate_stage,
    staged,
)
from clothsim.garments.tightness import Tightness, tight_notes, tight_parts_of_run
from clothsim.garments.waistband import edges_held, slid
from transfer.errors import TransferError
from transfer.signed_distance import BodySurface

SLID = 0.07
"""Descent from the placement, as a fraction of the body's height, beyond which a note says so."""
HIPS = 0.5
"""Level below which what was placed on the shoulders has slid off, as a fraction of the body's height: waists are at
.62."""
HEADGEAR = 0.25
"""Largest height of a garment that may be worn on top of the head, as a fraction of the body's."""


@dataclass(frozen=True)
class DressTask:
    """What all stages share: the body and its surface, fabric, directory and listeners.

    ends: the `process_time` at which the budget of all stages is spent; crotch: height of that of graded trousers at
    most [m]; halvings: of the sides of all triangles, before the drape.
    """

    body: BodyMesh
    surface: BodySurface
    fabrics: Fabrics
    waistband: bool
    directory: Path
    on_stage: StageCallback
    progress: Listener | None
    announce: Announcement | None
    ends: float = np.inf
    crotch: float = np.inf
    halvings: int = 0


@dataclass(frozen=True)
class DressState:
    """The garment so far, and the body that it is sewn on, in its pose; status and reason: as of `Dress`.

    between: limbs of the body between the sides of seams that stay open.
    """

    state: SewingState
    on: Wearer
    stages: tuple[Stage, ...]
    status: str = "completed"
    reason: str = ""
    notes: tuple[str, ...] = ()
    run: Run | None = None
    closing: tuple[Run, ...] = ()
    between: tuple[str, ...] = ()
    tight: Mapping[str, Tightness] = field(default_factory=dict)

    @property
    def failure(self) -> str:
        """Reason for a failure; empty while nothing failed."""
        return self.reason if self.status == "failed" else ""

    @property
    def what_is_left(self) -> tuple[bool, bool, int, float]:
        """Whether it failed, whether it does not rest, its open seams unless it failed, and its widest gap [m]."""
        open_seams = 0 if self.failure else len(self.state.open_seams)
        return bool(self.failure), self.status != "completed", open_seams, worst_gap(self.state)[0]

    def failed(self, reason: str) -> "DressState":
        """Copy that failed for a reason; as it is for none."""
        return replace(self, status="failed", reason=reason) if reason else self


def _add_stage(
    task: DressTask, done: DressState, name: str, state: SewingState, description: str, started: float
) -> DressState:
    """The garment after a stage."""
    made = lambda: (state.positions, description)  # noqa: E731
    stage = staged(name, state.triangles, done.on.surface, made, task.on_stage, started)
    return replace(done, state=state, stages=(*done.stages, stage))


def _place(task: DressTask, done: DressState) -> DressState:
    """Panels as placed; seams that touch are welded."""
    started, state = process_time(), done.state
    touching = touching_seams(state)
    state, tip_notes = parted(state.weld(touching))
    state, lift_note = lifted(state, done.on.body, done.on.surface)
    state, aside_notes = centred(state, done.on.body)
    state, tube_notes = closed_round_legs(state, done.on.body, done.on.surface)
    state, sleeve_notes = sleeves_cleared(state, done.on.body, done.on.surface)
    notes = (*done.notes, *tip_notes, *([lift_note] if lift_note else []), *aside_notes, *tube_notes, *sleeve_notes)
    done = replace(done, notes=notes)
    panels, seams = len(state.mesh.pattern.panels), len(state.mesh.seams)
    size = f"{panels} panels, {seams} seams, {len(state.positions):,} vertices"
    return _add_stage(task, done, "place", state, f"{size}, {len(touching)} seams touch" if touching else size, started)


def _separate(task: DressTask, done: DressState) -> DressState:
    """Panels moved apart where they intersect one another or the body."""
    started = process_time()
    state, description = separated(done.state, done.on.body, done.on.surface)
    done = _add_stage(task, done, "separate", state, description, started)
    counts = done.stages[-1].counts
    if counts.clean:
        return done
    names = ", ".join(panels_in_contact(state, done.on.surface))
    return done.failed(f"Placed panels intersect, and no way out was found: {names} ({counts}).")


def _approach(task: DressTask, done: DressState) -> DressState:
    """Panels moved toward the body."""
    started = process_time()
    return _add_stage(task, done, "approach", *approached(done.state, done.on.body, done.on.surface), started)


def _close(task: DressTask, done: DressState) -> DressState:
    """Seams drawn together under contact."""
    started = process_time()
    try:
        closing = close(done.state, done.on, task.fabrics, task.directory, task.progress, task.ends)
    except InputError as error:
        return done.failed(f"The closing could not start: {error.sentence}")
    done = _add_stage(task, done, "close", closing.state, closing.description, started)
    return replace(done.failed(closing.failure), closing=closing.runs, between=closing.between)


def _weld(task: DressTask, done: DressState) -> DressState:
    """Seams welded; those whose weld would intersect stay springs, and are named."""
    started, surface = process_time(), done.on.surface
    refused = welded_where_closed(done.state, np.inf, surface)
    state = welded_and_untangled(refused, surface)
    untangled = [refused.mesh.seams[k].name for k in refused.open_seams if k in state.welded]
    if untangled:
        done = replace(done, notes=(*done.notes, f"cloth lay between the sides, moved out: {', '.join(untangled)}"))
    springs = [state.mesh.seams[k].name for k in state.open_seams]
    if springs:
        note = f"stay springs, as their weld would intersect: {', '.join(springs)}"
        done = replace(done, notes=(*done.notes, note))
    welded = f"{len(state.welded)} seams"
    return _add_stage(
        task, done, "weld", state, f"{welded}, {len(springs)} stay springs" if springs else welded, started
    )


def _return(task: DressTask, done: DressState) -> DressState:
    """The body moved back to its own pose under the garment."""
    started = process_time()
    try:
        run = returned_body(done.state, done.on, task)
    except InputError as error:
        return done.failed(f"The body could not move back to its pose: {error.sentence}")
    if run.status != "completed":
        return done.failed(f"While the body moved back to its pose: {run.reason}")
    done = replace(done, on=Wearer(task.body, task.surface))
    state = done.state.moved_to(run.positions(-1))
    return _add_stage(task, done, "return", state, f"the body is back in its pose after {run.times[-1]:.2g} s", started)


def _refine(task: DressTask, done: DressState) -> DressState:
    """Each triangle divided into four, once or several times; the surface stays."""
    started, state = process_time(), done.state
    for _ in range(task.halvings):
        state = state.halved()
    if state.open_seams:  # the weld of smaller triangles may be free where that of larger ones intersected
        state = welded_where_closed(state, np.inf, done.on.surface)
    done = _add_stage(task, done, "refine", state, f"{len(state.positions):,} vertices", started)
    counts = done.stages[-1].counts
    return done if counts.clean else done.failed(f"The refined garment intersects: {counts}, {counts.where}.")


def _drape(task: DressTask, done: DressState) -> DressState:
    """Drape; one that is stopped ends at its last frame.

    Where it cannot start, or that frame is not free of intersections, the garment as sewn is the result.
    """
    started, held = process_time(), done.state
    if task.waistband:
        held, notes = edges_held(done.state, task.body)
        done = replace(done, notes=(*done.notes, *notes))
    try:
        run = drape_sewn(held, task)
    except InputError as error:
        return replace(done, status="sewn", reason=f"The drape could not start: {error.sentence}")
    ended = f"draped for {run.times[-1]:.3g} s"
    draped = _add_stage(task, done, "drape", done.state.moved_to(run.positions(-1)), ended, started)
    if run.status != "completed":
        reached = draped if draped.stages[-1].counts.clean else done
        return replace(reached, run=run, status="sewn", reason=f"{run.reason} The garment is sewn but not at rest.")
    draped = replace(draped, run=run)
    counts = draped.stages[-1].counts
    if not counts.clean:
        return draped.failed(f"The drape ended with {counts}, {counts.where}.")
    gap, name = worst_gap(draped.state)
    below = descent_of_top(draped.state.mesh.positions, draped.state.positions, task.body.up)
    failure = fallen(done.state.positions, draped.state.positions, task.body)
    failure = failure or not_worn(draped.state, task.body, task.waistband)
    if gap > mean_edge(draped.state):
        failure = f"Seam {name}, held by springs, opened to {1e3 * gap:.3g} mm in the drape."
    if failure:
        return draped.failed(failure)
    if below > SLID * task.body.height:
        note = f"the top of the garment lies {1e3 * below:.0f} mm below where its pattern places it"
        draped = replace(draped, notes=(*draped.notes, note))
    every = np.arange(len(draped.state.triangles))
    tight = tight_parts_of_run(run, {name: every[rows] for name, rows in draped.state.mesh.faces.items()})
    at_rest = (*slid(done.state, draped.state, task.body), *tight_notes(tight))
    draped = replace(draped, notes=(*draped.notes, *at_rest), tight=tight)
    status, reason = end_of_drape(draped.state, run, task.body.name)
    return replace(draped, status=status, reason=reason)


def descent_of_top(before: Floats, after: Floats, up: Floats) -> float:
    """How much lower the highest point of a garment lies, from positions (n, 3) [m] to others [m]."""
    return float((before @ up).max() - (after @ up).max())


def fallen(before: Floats, after: Floats, body: BodyMesh) -> str:
    """The sentence that a garment, positions (n, 3) [m] before and after a drape, fell off; empty where it did not."""
    moved = float(np.abs((after - before) @ body.up).max())
    if moved <= 0.5 * body.height:
        return ""
    return f"The garment falls off {body.name}: it moved by {moved:.2g} m."


def slid_off(placed: Floats, worn: Floats, body: BodyMesh, waistband: bool) -> str:
    """The sentence that a garment slid off, from positions (n, 3) [m] to others; empty where it did not.

    What was placed on the shoulders must stay above the hips, and what was placed on the trunk above the crotch.
    """
    on_shoulders = hangs_on_shoulders(placed, body, level=CHEST)
    try:
        crotch = body.parts.landmarks["crotch"]
    except TransferError:  # it has no legs that a garment could fall down
        crotch = 0.0
    before, top = (float((positions @ body.up).max()) - body.floor for positions in (placed, worn))
    lowest, down = HIPS * body.height if on_shoulders else crotch, descent_of_top(placed, worn, body.up)
    if not (top < lowest < before and down > SLID * body.height):
        return ""
    remedy = "" if on_shoulders or waistband else " With --waistband its upper edge is taken in."
    return f"The garment slid off {body.name}: its top lies {1e3 * down:.0f} mm below its place.{remedy}"


def not_worn(state: SewingState, body: BodyMesh, waistband: bool = False) -> str:
    """Why a draped garment is not worn, in a sentence; empty where it is. waistband: its upper edge was taken in.

    A garment that is too tall for the body closes above its head: hoods and raised arms may reach there, its torso not.
    """
    if slid := slid_off(state.mesh.positions, state.positions, body, waistband):
        return slid
    highest = float((state.positions @ body.up)[torso(state)].max(initial=-np.inf))
    above = highest - body.floor - body.height
    if above > 0.0 and np.ptp(state.mesh.positions @ body.up) > HEADGEAR * body.height:
        return f"The garment closed above the head of {body.name}: it reaches {1e3 * above:.0f} mm higher."
    if not surrounds(state.positions, state.triangles, body):
        return f"The garment surrounds no part of {body.name}."
    return ""


def end_of_drape(state: SewingState, run: Run, body: str) -> tuple[str, str]:
    """Status of a garment whose drape completed, and what was closed and whether it rests, in a sentence."""
    seams, (gap, name) = len(state.mesh.seams), worst_gap(state)
    closed = f"All {seams} seams are closed"
    if state.open_seams:
        closed = f"{len(state.welded)} of {seams} seams are welded throughout, springs hold the rest, within "
        closed += f"{1e3 * gap:.2g} mm ({name})"
    if moving := unrest(run, body):
        return "sewn", f"{closed}, but the garment is {moving}."
    return "completed", f"{closed}, and the garment rests on {body}."


def unrest(run: Run, body: str) -> str:
    """How a completed run ended, "not at rest on ... (fastest vertex 3 mm/s)"; empty where it is at rest."""
    certificate = run.summary["certificate"]
    if certificate["at_rest"]:
        return ""
    return f"not at rest on {body} (fastest vertex {length_text(certificate['fastest_speed'] or 0.0)}/s)"


STAGES = (
    PlannedStage("place", _place),
    PlannedStage("separate", _separate, lambda task, done: not done.stages[-1].counts.clean),
    PlannedStage("approach", _approach, lambda task, done: bool(done.state.open_seams)),
    PlannedStage("close", _close, lambda task, done: bool(done.state.open_seams)),
    PlannedStage("weld", _weld),
    PlannedStage("return", _return, lambda task, done: done.on.body is not task.body),
    PlannedStage("refine", _refine, lambda task, done: task.halvings > 0),
    PlannedStage("drape", _drape),
)
"""Stages of dressing."""


FRICTION = 0.4
SLIPPERY = 0.05
"""Friction while a garment is shaken down."""
SANK = 0.03
"""Descent of the top of a garment, as a fraction of the body's height, beyond which it was held by friction alone."""


def open_seam_tables(state: SewingState) -> list[dict[str, Any]]:
    """Tables of `[effects.seams]` for the pairs of seams that are not welded, also where a seam has one alone."""
    lines = [state.pairs(state.mesh.seams[k]).T for k in state.open_seams]
    return [
        {"from": {"vertices": a.tolist()}, "to": {"vertices": b.tolist()}, "match": "vertices", "end": 1e-3}
        for a, b in lines
    ]


def drape_sewn(state: SewingState, task: DressTask) -> Run:
    """Run of the garment under gravity until it rests.

    One that hangs on the shoulders is shaken down before, in the folder `shaken`; that is left out where it sinks, or
    does not complete.

    Raises
    ------
    InputError
        A start that cannot be simulated.
    """
    body = task.body
    if hangs_on_shoulders(state.positions, body):
        first = named_stage("shake down, before the drape", task.progress)
        shaken = _drape_with_friction(state, task, task.directory / "shaken", SLIPPERY, first)
        sank = descent_of_top(state.positions, shaken.positions(-1), body.up)
        if shaken.status == "completed" and sank < SANK * body.height:
            state = state.moved_to(shaken.positions(-1))
    last = named_stage("drape, the last stage", task.progress)
    return _drape_with_friction(state, task, task.directory, FRICTION, last)


def returned_body(state: SewingState, posed: Wearer, task: DressTask) -> Run:
    """Run of the garment under a body that moves from the pose in which it was sewn to its own.

    Raises
    ------
    InputError
        A start that cannot be simulated.
    """
    rate = (len(posed.way) - 1) / MOTION_SECONDS
    moving = Body(posed.way[0], posed.body.triangles, frames=posed.way, frames_per_second=rate, name="body")
    stiffness = carrying_stiffness(task.fabrics.main, posed.way[-1])
    scene = fit_motion(stiffness, open_seam_tables(state), self_contact=True, slips=False).scene(
        cloth=sewn_cloth(state, task.fabrics), body=moving
    )
    listener = named_stage("body back to its pose", task.progress)
    return simulate_stage(scene, task.directory / "return", listener, ends=task.ends)


def _drape_with_friction(
    state: SewingState, task: DressTask, folder: Path, friction: float, listener: Listener | None
) -> Run:
    body = task.body
    scene = dress_drape(body.up, open_seam_tables(state), friction).scene(
        cloth=sewn_cloth(state, task.fabrics), body=Body(body.positions, body.triangles, name="body")
    )
    return simulate_stage(scene, folder, listener, task.announce, task.ends)
