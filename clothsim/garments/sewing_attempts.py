"""Attempts at sewing a pattern: on a coarser mesh first, and with limbs of the body out of the way of its seams.

What is in the way is seen where an attempt fails, or before: strings between the sides of a seam that would run through
an arm. Each attempt is all `STAGES` of the pipeline; the runs of the better one stay in the directory.
"""

import shutil
import tempfile
from dataclasses import replace
from pathlib import Path
from time import process_time

import numpy as np

from clothsim import Pattern
from clothsim.base.errors import InputError
from clothsim.base.file_writing import make_directory
from clothsim.base.record import RECORD_NAME, SUMMARY_NAME
from clothsim.files import CHECKPOINT_NAME, TRAJECTORY_NAME
from clothsim.garments.dress.corrections import lifted
from clothsim.garments.dress.fans import folded_fans
from clothsim.garments.dress.limbs import Wearer, legs_beside, sewing_pose
from clothsim.garments.dress.pipeline import STAGES, DressState, DressTask
from clothsim.garments.dress.placement import placed_on, turned_to_arms, turned_to_legs
from clothsim.garments.dress.rings import arms_between, lowered_to_crotch
from clothsim.garments.dress.sewing_state import as_placed
from clothsim.garments.stages import run_stages
from clothsim.patterns import PatternMesh, joined_vertices, mesh_pattern

Sewn = tuple[DressState, DressState]
"""A garment as placed, and after all stages."""
COARSEST = 0.028
"""Largest size of a mesh that is sewn and then refined, as a fraction of the body's height: 4.8 cm of 1.7 m."""


def sewn_at(task: DressTask, pattern: Pattern, size: float, origin: str, coarse: bool, notes: tuple[str, ...]) -> Sewn:
    """The garment as placed and after all stages.

    coarse: first on a coarser mesh, which is refined; where that fails, on that of the size itself.

    InputError for a pattern that cannot be meshed.
    """
    coarsest = COARSEST * task.body.height
    halvings = max(0, int(np.log2(coarsest) - np.log2(size))) if coarse else 0
    if halvings:
        try:
            mesh, mesh_notes = _placed_mesh(task, pattern, size, origin, halvings)
        except InputError as error:
            notes = (*notes, f"not sewn on a coarser mesh: {error.sentence}")
        else:
            first = _sewn_in_poses(replace(task, halvings=halvings), mesh, (*mesh_notes, *notes))
            if not first[1].failure or process_time() >= task.ends:
                return first
            notes = (*notes, f"sewn again on the finer mesh: on the coarser one, {_reason(first)}")
    mesh, mesh_notes = _placed_mesh(task, pattern, size, origin, 0)
    return _sewn_in_poses(task, mesh, (*mesh_notes, *notes))


def _placed_mesh(
    task: DressTask, pattern: Pattern, size: float, origin: str, halvings: int
) -> tuple[PatternMesh, tuple[str, ...]]:
    """The panels meshed and placed round the body, and notes."""
    mesh, placing_notes = placed_on(mesh_pattern(pattern, size, halvings), task.body, origin)
    joined_vertices(mesh)  # an error now, not after the closing
    mesh, arm_notes = turned_to_arms(mesh, task.body)
    mesh, fan_notes = folded_fans(mesh, task.body, task.surface)
    return mesh, (*mesh.pattern.notes, *placing_notes, *arm_notes, *fan_notes)


def _sewn_in_poses(task: DressTask, mesh: PatternMesh, notes: tuple[str, ...]) -> Sewn:
    """The garment as placed and after all stages; the better of two attempts where not every seam is welded.

    First with the arms raised where they are in the way of the panels as they will be lifted (`arms_between`), else in
    the body's own pose; then also with the limbs out of the way that seams stayed open about, or the arms where only
    cloth is between, or the legs where springs hold a seam beside them.
    """
    make_directory(task.directory)
    shutil.rmtree(_set_aside(task.directory))  # the runs of an earlier command, or of the coarser mesh
    own = Wearer(task.body, task.surface)
    in_the_way = arms_between(lifted(as_placed(mesh), task.body, task.surface)[0], own)
    posed, change = sewing_pose(own, in_the_way)
    raised = f"sewn with {change}: strings would run through {' and '.join(f'the {limb}' for limb in in_the_way)}"
    first = _sewn(task, mesh, posed, (*notes, raised) if change else notes)
    done = first[1]
    unsewn = bool(done.failure) and done.run is None  # else it was sewn, and may have slid off in its drape
    limbs = (done.between if done.failure else ()) or legs_beside(done.state, task.body) or (ARMS if unsewn else ())
    if process_time() >= task.ends or not limbs:
        return first
    second, differently = sewing_pose(own, (*in_the_way, *limbs))
    if differently == change:
        if not (change and unsewn):
            return first
        second, differently = own, "the body in its own pose"
    note = f"sewn again with {differently}: at first, {_reason(first)}"
    aside = _set_aside(task.directory)
    again = None
    try:
        again = _sewn(task, mesh, second, (*notes, note))
    finally:
        worse = again is None or again[1].what_is_left > done.what_is_left
        if worse:
            shutil.rmtree(_set_aside(task.directory))
            for file in aside.iterdir():
                file.rename(task.directory / file.name)
        shutil.rmtree(aside)
    if worse:
        return first[0], replace(done, notes=(*done.notes, f"sewn again with {differently}, which was no better"))
    return again


ARMS = ("left arm", "right arm")
"""Limbs that are moved out of the way where only cloth is between the sides of a seam: it may hang over them."""
RUNS = ("close[0-9]*", "return", "shaken", TRAJECTORY_NAME, CHECKPOINT_NAME, RECORD_NAME, SUMMARY_NAME)
"""Files and folders of the runs of a dressing."""


def _set_aside(directory: Path) -> Path:
    """Move the runs of a dressing into a new folder beside them, and return it."""
    aside = Path(tempfile.mkdtemp(prefix="attempt-", dir=directory))
    for name in RUNS:
        for file in directory.glob(name):
            if file.is_file() or (file / RECORD_NAME).exists():  # not a folder of the user's
                file.rename(aside / file.name)
    return aside


def _reason(sewn: Sewn) -> str:
    """Why a garment failed, or how it was sewn, to follow a colon."""
    return f"{sewn[1].reason[:1].lower()}{sewn[1].reason[1:]}"


def _sewn(task: DressTask, mesh: PatternMesh, on: Wearer, notes: tuple[str, ...]) -> Sewn:
    """The panels as placed on a body in a pose, and the garment after all stages."""
    if on.body is not task.body:
        mesh, _ = turned_to_arms(mesh, on.body)
    mesh, lowered_notes = lowered_to_crotch(mesh, on.body, task.crotch)
    mesh, leg_notes = turned_to_legs(mesh, on.body, on.surface)
    begun = DressState(as_placed(mesh), on, (), notes=(*notes, *lowered_notes, *leg_notes))
    return begun, run_stages(STAGES, task, begun)
