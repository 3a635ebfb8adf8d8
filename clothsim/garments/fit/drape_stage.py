"""Drape of a fitted garment, the last stage of a fit, and whether the garment stays on the body."""

from typing import NamedTuple

from clothsim import Run
from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.engine import Announcement
from clothsim.garments.body_overlap import carried_rows
from clothsim.garments.fit.moving_body import draped, named_stage
from clothsim.garments.fit.pipeline import Seeded, Task
from clothsim.garments.fit.stage import Stage, staged
from clothsim.garments.penetration import NO_ROWS

FALLING = 0.5
"""Largest speed at the end of a drape [m/s] for a garment that rests on the body."""


class Ended(NamedTuple):
    """End of a drape."""

    status: str
    reason: str
    run: Run | None
    stages: tuple[Stage, ...]
    carried: Ints = NO_ROWS


def drape_stage(task: Task, seeded_fit: Seeded, announce: Announcement | None) -> Ended:
    """Drape; where it cannot start or complete, its start is the result, with status refined."""
    body = seeded_fit.body
    runs: list[Run] = []

    def make() -> tuple[Floats, str]:
        start, up = seeded_fit.last.positions, task.target.up
        progress = named_stage("simulate", task.progress)
        worn, folder, opened = seeded_fit.worn, task.folder, seeded_fit.overlap.opened
        runs.append(draped(worn, start, body.positions, up, folder, progress, announce, opened=opened))
        return runs[0].positions(-1), f"draped for {runs[0].times[-1]:g} s"

    def carried() -> Ints:
        if not len(seeded_fit.overlap):
            return NO_ROWS
        return carried_rows(seeded_fit.overlap, runs[0].positions(-1), runs[0].field("carried", -1) > 0)

    try:
        stage = staged("simulate", task.garment.triangles, body, make, task.on_stage, carried=carried)
    except InputError as error:
        return Ended("refined", f"The drape could not start: {error.sentence}", None, seeded_fit.stages)
    run = runs[0]
    if run.status != "completed":
        return Ended("refined", run.reason, run, seeded_fit.stages)
    if not stage.counts.clean:
        reason = f"The drape ended with {stage.counts}, {stage.counts.where}."
        return Ended(
            "refined", reason, run, seeded_fit.stages if seeded_fit.last.counts.clean else (*seeded_fit.stages, stage)
        )
    fallen = _fallen(run, task.target.name)
    stages = (*seeded_fit.stages, stage)
    return Ended("failed" if fallen else "completed", fallen or run.reason, run, stages, carried())


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
