"""Heights at which the panels of a pattern are worn, seen where it is sewn on the body that it was cut for.

Panels are drawn flat round a body: what hangs from the shoulders lower than it is worn, skirts below the waist, and
tiers one below another with gaps. By the heights at which they are drawn, the waist of a skirt would grow as hips do.
"""

import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from time import process_time

import numpy as np

from clothsim import Pattern, Progress
from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError, MachineError
from clothsim.base.file_writing import make_directory
from clothsim.garments.dress.pipeline import SLID, DressTask, descent_of_top
from clothsim.garments.dress.placement import chosen_origin, height_of_origin
from clothsim.garments.dress.sewing_state import SewingState
from clothsim.garments.inputs import BodyMesh, known_surface
from clothsim.garments.sewing_attempts import COARSEST, sewn_at
from clothsim.garments.stages import Stage
from transfer.errors import TransferError

Levels = Callable[[Floats], Floats]
"""Heights at which a panel is worn of those at which it is drawn, both (k,) [m] above the ground."""
BUDGET = 0.5
"""Part of a budget that may be spent on the body that the pattern was cut for."""
HIGHEST = 0.9
"""Quantile of the heights at which what is drawn at one height is worn: a circle skirt has its waist and its hem at one
height, and it is the waist that must fit."""


def as_drawn(heights: Floats) -> Floats:
    """Levels of a panel that is worn where it is drawn."""
    return heights


@dataclass(frozen=True)
class WornLevels:
    """Levels by panel, and a note how they were found; a panel without is worn as it is drawn."""

    by_panel: Mapping[str, Levels] = field(default_factory=dict)
    note: str = "graded by the heights at which panels are drawn"

    def of(self, panel: str) -> Levels:
        """Levels of a panel."""
        return self.by_panel.get(panel, as_drawn)


DRAWN = WornLevels()
"""Levels of a pattern that is worn as it is drawn."""


def worn_levels(task: DressTask, source: BodyMesh, pattern: Pattern, origin: str) -> WornLevels:
    """Levels of a pattern that is sewn as in a task, but on the body that it was cut for, on a coarse mesh.

    As drawn, with the reason in the note, where it cannot be sewn there, or slides down: graded by the girth of what
    stopped it, it would slide farther.

    Parameters
    ----------
    task : DressTask
        Sewing on another body; its fabrics, waistband, budget and listeners are used.
    source : BodyMesh
        The body that the pattern was cut for.
    pattern : Pattern
        The pattern as it is cut.
    origin : str
        Level y = 0 of the pattern (see `placement.placed_on`).
    """
    size, on = COARSEST * source.height, f"on {source.name}"
    progress, ends = task.progress, process_time() + BUDGET * (task.ends - process_time())

    def on_stage(stage: Stage) -> None:
        task.on_stage(replace(stage, name=f"{stage.name} {on}"))

    def on_step(step: Progress) -> None:
        if progress is not None:
            progress(replace(step, stage=f"{step.stage}, {on}"))

    make_directory(task.directory)
    with tempfile.TemporaryDirectory(prefix="worn-", dir=task.directory) as folder:
        try:
            own = replace(task, body=source, surface=known_surface(source.positions, source.triangles))
            own = replace(own, directory=Path(folder), on_stage=on_stage, announce=None, ends=ends)
            own = replace(own, progress=on_step if progress else None)
            _, done = sewn_at(own, pattern, size, origin, coarse=False, notes=())
            down = descent_of_top(done.state.mesh.positions, done.state.positions, source.up)
            slid = f"its top slid down by {1e3 * down:.0f} mm." if down > SLID * source.height else ""
            reason = done.failure or slid
        except (InputError, TransferError) as error:
            if isinstance(error, MachineError):  # nothing that the pattern tells
                raise
            reason = error.sentence if isinstance(error, InputError) else str(error)
    if reason:
        return replace(DRAWN, note=f"{DRAWN.note}, as it is not worn {on}: {reason}")
    drawn_points = np.concatenate([panel.placed(panel.vertices)[:, 1] for panel in pattern.panels.values()])
    floor = height_of_origin(source, chosen_origin(drawn_points, origin))
    heights = done.state.positions[done.state.number] @ source.up - source.floor
    note = f"graded by the heights at which panels are worn {on}: sewn there at {1e3 * size:.0f} mm"
    if done.status != "completed":
        note = f"{note}, and stopped before it was at rest: {done.reason}"
    return WornLevels(levels_by_panel(done.state, pattern, heights, floor, size), note)


def levels_by_panel(
    state: SewingState, pattern: Pattern, heights: Floats, floor: float, size: float
) -> dict[str, Levels]:
    """Levels of each panel: at rows of vertices about `size` apart, and straight between them.

    heights: at which the vertices of the panels (n,) are worn; floor: of y = 0; size: of the mesh [m].
    """
    found: dict[str, Levels] = {}
    for name, panel in pattern.panels.items():
        vertices = state.mesh.vertices[name]
        drawn = panel.placed(state.mesh.panel_coordinates[vertices])[:, 1] + floor
        rows = np.linspace(drawn.min(), drawn.max(), 1 + int(np.ptp(drawn) / size))
        near = np.abs(drawn - rows[:, None]) <= max(size, float(np.ptp(rows)) / max(len(rows) - 1, 1)) / 2
        higher = np.array([np.quantile((heights[vertices] - drawn)[row], HIGHEST) for row in near])

        def level(wanted: Floats, rows: Floats = rows, worn: Floats = rows + higher) -> Floats:
            return np.interp(wanted, rows, worn)

        found[name] = level
    return found
