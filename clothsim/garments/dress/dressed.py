"""Dressed garment: what `dress` returns, and the files that it leaves."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from clothsim import Pattern, Run
from clothsim.base.arrays import Floats
from clothsim.base.file_writing import write_atomically
from clothsim.base.record import SUMMARY_NAME, read_summary, write_summary
from clothsim.engine import Fabric
from clothsim.garments.dress.closing import stretch_range
from clothsim.garments.dress.grading import Grading
from clothsim.garments.dress.measurements import measurement_entries
from clothsim.garments.dress.sewing_state import SewingState
from clothsim.garments.inputs import BodyMesh
from clothsim.garments.penetration import Counts
from clothsim.garments.stages import Stage
from clothsim.patterns import write_specification
from clothsim.render import draw_pattern, laid_out


@dataclass(frozen=True)
class Dress:
    """Result of `dress`.

    Attributes
    ----------
    directory : Path
        Output directory.
    status : str
        "completed" (every seam is closed and the garment rests on the body, free of intersections), "sewn" (closed and
        free of intersections, but its drape did not complete) or "failed".
    reason : str
        Reason for the status, one sentence.
    pattern : Pattern
        Pattern as sewn: as read, or graded.
    placed : SewingState
        Panels as placed.
    state : SewingState
        Garment at the end: positions, triangles, welded seams.
    body : BodyMesh
        Body that wears it.
    stages : tuple of Stage
        Stages in order, each with positions and penetration counts.
    run : Run or None
        Drape; None where none was started.
    notes : tuple of str
        Defaults used in reading and dressing.
    closing : tuple of Run
        Rounds in which the seams were closed.
    fabrics : mapping of str to Fabric
        Fabric of each panel.
    grading : Grading or None
        Factors by which the pattern was graded; None: it is as it was cut.

    Examples
    --------
    >>> import clothsim
    >>> worn = clothsim.dress("shirt_specification.json", on="body.obj")  # doctest: +SKIP
    >>> worn.status, worn.counts.clean  # doctest: +SKIP
    ('completed', True)
    """

    directory: Path
    status: str
    reason: str
    pattern: Pattern
    placed: SewingState
    state: SewingState
    body: BodyMesh
    stages: tuple[Stage, ...]
    run: Run | None
    notes: tuple[str, ...]
    closing: tuple[Run, ...] = ()
    fabrics: Mapping[str, Fabric] = field(default_factory=dict)
    grading: Grading | None = None

    @property
    def positions(self) -> Floats:
        """Positions of the garment at its end, (n, 3) [m]."""
        return self.state.positions

    @property
    def counts(self) -> Counts:
        """Penetration counts of the last stage by the exact check."""
        return self.stages[-1].counts

    @property
    def stretch(self) -> tuple[float, float]:
        """1st and 99th percentile of the principal stretches against the pattern."""
        return stretch_range(self.state.stretches())


GARMENT, PATTERN, DRAWING = "garment.obj", "pattern.json", "pattern.svg"
GRADED = "graded_specification.json"
REMEDY = "Look at the pattern (pattern.svg) and at the panels as placed: `clothsim check` names what intersects."


def write_results(done: "Dress", name: str, size: float, seconds: float) -> None:
    """Write the garment, its pattern, the drawing, and the stages in the summary."""
    directory = done.directory
    directory.mkdir(parents=True, exist_ok=True)
    write_atomically(directory / GARMENT, sewn_obj(done.state).encode())
    write_specification(directory / PATTERN, done.pattern)
    if done.grading is not None:
        write_specification(directory / GRADED, done.pattern)
    draw_pattern(directory / DRAWING, done.pattern, name)
    file = directory / SUMMARY_NAME
    previous = read_summary(file) if done.run is not None else {"failure": None, "certificate": None, "notes": []}
    low, high = done.stretch
    entries: dict[str, Any] = {
        "status": done.status,
        "reason": done.reason,
        "stages": [stage.as_dict() for stage in done.stages],
        "seams": seam_entries(done.state),
        "measurements": measurement_entries(done.state, done.body, done.fabrics),
        "grading": None if done.grading is None else done.grading.as_dict(),
        "vertices": len(done.state.positions),
        "spacing": size,
        "stretch_low": low,
        "stretch_high": high,
        "notes": [*done.notes, *previous["notes"]],
        "dress_seconds": seconds,
    }
    if done.status == "failed":
        position = done.counts.position
        failed = {"cause": "dress", "sentence": done.reason, "element": str(done.counts), "position": position}
        entries["failure"] = {**failed, "remedy": REMEDY, **dict.fromkeys(("step", "time", "dt"))}
    write_summary(file, {**previous, **entries})


def seam_entries(state: SewingState) -> list[Mapping[str, Any]]:
    """Name, lengths of both sides [m], gap [m] and welded or not of each seam."""
    entries: list[Mapping[str, Any]] = []
    for k, seam in enumerate(state.mesh.seams):
        first, second = (state.mesh.pattern.panels[side.panel].edge_length(side.edge) for side in seam.stitch.sides)
        gap = float(state.gaps(seam).max(initial=0.0))
        entries.append({"name": seam.name, "lengths": [first, second], "gap": gap, "welded": k in state.welded})
    return entries


def sewn_obj(state: SewingState) -> str:
    """OBJ of the sewn garment: welded vertices, the pattern as texture coordinates, a group for each panel."""
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in state.positions.tolist()]
    lines += [f"vt {u!r} {v!r}" for u, v in _texture(state).tolist()]
    corners = np.stack([state.triangles, state.mesh.triangles], axis=2) + 1
    for name, rows in state.mesh.faces.items():
        lines.append(f"g {'_'.join(name.split())}")
        lines += [f"f {' '.join(f'{v}/{t}' for v, t in face)}" for face in corners[rows].tolist()]
    return "\n".join(lines) + "\n"


def _texture(state: SewingState) -> Floats:
    """Texture coordinates of each vertex of the panels, (n, 2) [m]: as laid out, y along the warp."""
    shifts, _ = laid_out({name: panel.outline for name, panel in state.mesh.pattern.panels.items()})
    coordinates = state.mesh.panel_coordinates.copy()
    for name, rows in state.mesh.vertices.items():
        coordinates[rows] += shifts[name]
    return coordinates
