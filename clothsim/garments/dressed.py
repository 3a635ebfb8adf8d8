"""Dress: a sewing pattern meshed, placed, closed round a body, welded and draped; its result and its files."""

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from clothsim import Cloth, Pattern, Run
from clothsim.base.arrays import Floats, as_positive
from clothsim.base.errors import InputError, MachineError
from clothsim.base.file_writing import write_atomically
from clothsim.base.inputs import is_number, renamed, shown, with_remedies
from clothsim.base.process_memory import Stopwatch
from clothsim.base.record import SUMMARY_NAME, read_summary, write_summary
from clothsim.engine import Fabric, example_file, refuse_earlier_run
from clothsim.files import read_pattern
from clothsim.garments.dress.closing import stretch_range
from clothsim.garments.dress.grading import Grading, graded, sizes_between
from clothsim.garments.dress.measurements import measurement_entries
from clothsim.garments.dress.pipeline import DressTask
from clothsim.garments.dress.placement import refuse_unsuitable
from clothsim.garments.dress.sewing_state import Fabrics, SewingState
from clothsim.garments.dress.worn_levels import worn_levels
from clothsim.garments.fit.moving_body import BODY, REST, START
from clothsim.garments.inputs import BodyMesh, as_body_mesh, known_surface, read_body_mesh, stands
from clothsim.garments.penetration import Counts
from clothsim.garments.sewing_attempts import sewn_at
from clothsim.garments.stages import Announcement, Listener, Stage, StageCallback
from clothsim.garments.tightness import Tightness, tight_entries
from clothsim.garments.waistband import parts_for_edges
from clothsim.patterns import mesh_pattern, write_specification
from clothsim.render import draw_pattern, laid_out
from transfer.errors import TransferError
from transfer.signed_distance import BodySurface


@dataclass(frozen=True)
class Dress:
    """Result of `dress`.

    Attributes
    ----------
    directory : Path
        Output directory.
    status : str
        "completed" (every seam is closed and the garment rests on the body, free of intersections), "sewn" (closed and
        free of intersections, but its drape did not complete, or did not come to rest) or "failed".
    reason : str
        Reason for the status, one sentence.
    pattern : Pattern
        Pattern that was sewn: as read, or graded.
    placed : SewingState
        Panels as placed.
    state : SewingState
        Garment at the end: positions, triangles, welded seams.
    body : BodyMesh
        Body that wears it.
    stages : tuple of Stage
        Stages in order, each with positions and penetration counts.
    run : Run or None
        Drape; None if none was started.
    notes : tuple of str
        Defaults used in reading and dressing.
    closing : tuple of Run
        Rounds in which the seams were closed.
    fabrics : mapping of str to Fabric
        Fabric of each panel.
    grading : Grading or None
        Factors by which the pattern was graded; None: it was not graded.
    tight : mapping of str to Tightness
        Panels that are too tight, with stretch, pressure and ease; empty without a drape.

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
    tight: Mapping[str, Tightness] = field(default_factory=dict)

    @property
    def positions(self) -> Floats:
        """Final positions of the garment, (n, 3) [m]."""
        return self.state.positions

    @property
    def counts(self) -> Counts:
        """Penetration counts of the last stage by the exact check."""
        return self.stages[-1].counts

    @property
    def draped(self) -> bool:
        """True if the drape completed without intersections, whether at rest or still moving ("sewn")."""
        return self.status != "failed" and self.run is not None and self.run.status == "completed"

    @property
    def stretch(self) -> tuple[float, float]:
        """1st and 99th percentile of the principal stretches against the pattern."""
        return stretch_range(self.state.stretches())


GARMENT, PATTERN, DRAWING = "garment.obj", "pattern.json", "pattern.svg"
GRADED = "graded_specification.json"


def short_name(pattern: str | Path) -> str:
    """Name of the garment of a pattern file: "shirt" of shirt_specification.json."""
    return Path(pattern).stem.removesuffix("_specification")


REMEDY = "Check the pattern (pattern.svg) and the panels as placed: `clothsim check` names what intersects."


def write_results(done: "Dress", name: str, size: float, watch: Stopwatch) -> None:
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
        "pattern": name,
        "measurements": measurement_entries(done.state, done.body.bare, done.fabrics),
        "grading": None if done.grading is None else done.grading.as_dict(),
        "tight": tight_entries(done.tight),
        "vertices": len(done.state.positions),
        "spacing": size,
        "stretch_low": low,
        "stretch_high": high,
        "notes": [*done.notes, *previous["notes"]],
        "dress_seconds": watch.wall_seconds(),
        "cpu_seconds": watch.cpu_seconds(),
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
    shifts, _ = laid_out({name: panel.outline for name, panel in state.mesh.pattern.panels.items()})
    coordinates = state.mesh.panel_coordinates.copy()
    for name, rows in state.mesh.vertices.items():
        coordinates[rows] += shifts[name]
    lines += [f"vt {u!r} {v!r}" for u, v in coordinates.tolist()]
    corners = np.stack([state.triangles, state.mesh.triangles], axis=2) + 1
    for name, rows in state.mesh.faces.items():
        lines.append(f"g {'_'.join(name.split())}")
        lines += [f"f {' '.join(f'{v}/{t}' for v, t in face)}" for face in corners[rows].tolist()]
    return "\n".join(lines) + "\n"


EARLIER_NAMES = {"cut_for": "made_for", "hold": "waistband"}
"""Keywords of `dress` that have another name now."""


@renamed(**EARLIER_NAMES)
@with_remedies()
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
    coarse_sewing: bool = True,
    origin: str = "auto",
    rotation_order: str = "zyx",
    seams: str | Path | None = None,
    scale: float | None = None,
    body_group: str | Sequence[str] | None = None,
    budget: float | None = None,
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
        The body: a mesh file, a scene (its first body), or a mesh in memory in metres.
    output : str or Path, optional
        Directory for the run, `garment.obj`, the pattern and the summary; None: a new temporary one.
    size : float
        Distance between neighbouring vertices [m].
    fabric : str, optional
        A named fabric; None: cotton.
    fabrics : mapping of str to str, optional
        Named fabrics of single panels, by name; `*` stands for any characters: {"*cuff*": "denim"}.
    made_for : str, Path, Body or mesh object, optional
        The body that the pattern was cut for. The pattern is graded from the girths and lengths of this body to those
        of `on`. None: as cut.
    grade : mapping of str to float, optional
        Factors by name (`grading.NAMES`) in place of those between the two bodies; without `made_for` the others are 1.
    waistband : bool
        True: take in upper edges that would slide, to the girth of the body, before the drape (`edges_held`).
    coarse_sewing : bool
        True: sew on a mesh of 2, 4, 8, ... times the size, up to 0.028 of the body's height (4.8 cm of 1.7 m), whose
        triangles are divided into four, once or several times, before the drape. Where that mesh cannot be made or
        sewn, the garment is sewn on one of `size`. False: sew on that one at once.
    origin : str
        Meaning of y = 0 in the pattern: "floor", "waist" or "auto" (see `placement.placed_on`).
    rotation_order : str
        Order of the rotations of the panels, "zyx" or "xyz".
    seams : str or Path, optional
        TOML file with the seams and the placement of a DXF drawing; None: NAME.toml beside NAME.dxf.
    scale : float, optional
        Metres per unit of the body's file; None: from its height.
    body_group : str or sequence of str, optional
        Group of the body's file.
    budget : float, optional
        CPU time [s] after which no further round or step begins. The garment then fails, and its reason names the
        widest seam and what is between its sides; in its drape it is "sewn", as in the last frame. None: no limit.
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
    watch = Stopwatch()
    if budget is not None and not (is_number(budget) and budget > 0.0):
        raise InputError(f"budget is {shown(budget)}.", "Give CPU seconds, such as 240.0.")
    size = as_positive("The size of the mesh", size)
    chosen = Fabrics(fabric or Cloth.fabric, fabrics or {})
    pattern = example_file(pattern, "_specification.json", PATTERN_FILE)
    if not isinstance(output, str | Path | None):
        raise InputError(f"output is of the type {type(output).__name__}.", "Give the name of a directory.")
    directory = Path(tempfile.mkdtemp(prefix="clothsim-dress-")) if output is None else Path(output)
    inputs = (pattern, on, made_for, seams)
    refuse_earlier_run(directory, overwrite, (GARMENT, PATTERN, DRAWING, GRADED, REST, START, BODY), inputs)
    if not isinstance(pattern, str | Path | Pattern):
        raise InputError(f"pattern is of the type {type(pattern).__name__}.", "Give a file or a Pattern.")
    read = pattern if isinstance(pattern, Pattern) else read_pattern(pattern, rotation_order, seams)
    cut = read
    of_panels = chosen.of(read)
    name = "pattern" if isinstance(pattern, Pattern) else short_name(pattern)
    body = body_of_wearer(on, scale, body_group)
    if waistband:
        parts_for_edges(body)  # an error now, not after the closing
    ends = np.inf if budget is None else process_time() - watch.cpu_seconds() + budget
    task = DressTask(body, surface_of(body), chosen, waistband, directory, on_stage, progress, announce, ends)
    grading = None
    if made_for is not None or grade:
        source = body
        if made_for is not None:
            in_file = isinstance(made_for, str | Path)
            source = read_body_mesh(made_for, option="made_for") if in_file else as_body_mesh(made_for)
            refuse_unsuitable(source)
        sizes_between(source, body, grade or {})  # an error now, not after a sewing
        levels = worn_levels(task, source.bare, read, origin)
        grading = graded(read, source, body, origin, grade or {}, levels)
        read, origin, task = grading.pattern, grading.origin, replace(task, crotch=grading.crotch)
    about = () if stands(body) else (NOT_STANDING.format(body.name),)
    notes = (*(grading.notes if grading else ()), *body.notes, *about)
    try:
        begun, done = sewn_at(task, read, size, origin, coarse_sewing, notes)
    except InputError as error:
        if grading is None or isinstance(error, MachineError):
            raise
        mesh_pattern(cut, size)  # raises where the fault is one of the pattern as it is cut
        raise InputError(f"Graded to {body.name}: {error.sentence}", GRADED_BADLY) from error
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
        done.tight,
    )
    write_results(worn, name, size, watch)
    return worn


GRADED_BADLY = "Sew the pattern as it is cut, without --made-for, or give factors nearer to 1 (--grade)."
NOT_STANDING = "{} is not a standing person in metres: give another body, or its --scale"
PATTERN_FILE = "the specification.json of a sewing pattern, or one that comes with the package, such as tunic"
"""What the name of a pattern must be."""


def body_of_wearer(on: Any, scale: float | None, group: str | Sequence[str] | None) -> BodyMesh:
    """The body that wears a garment: a file, a mesh in memory, or as it is. InputError for one that cannot."""
    made = on if isinstance(on, BodyMesh) else None
    if made is None:
        made = read_body_mesh(on, scale=scale, group=group) if isinstance(on, str | Path) else as_body_mesh(on)
    refuse_unsuitable(made)
    return made


def surface_of(body: BodyMesh) -> BodySurface:
    """The body for distance queries. InputError for one without a volume."""
    try:
        return known_surface(body.positions, body.triangles)
    except TransferError as error:
        raise InputError(f"{body.name}: {error}") from error
