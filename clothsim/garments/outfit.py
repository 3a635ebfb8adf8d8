"""Outfits: several patterns sewn one over another in a given order, then all garments draped together.

Each garment is sewn on the body and a wrap of what it wears already, so that its stages are those of one garment on
one body, and what they do cannot touch the garments below. Then the wrap is left out: all garments fall onto the body
and one another under contact.
"""

import tempfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from clothsim import Body, Cloth, Pattern, Run, open_run
from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.base.file_writing import make_directory
from clothsim.base.inputs import renamed
from clothsim.base.record import SUMMARY_NAME, read_summary, write_summary
from clothsim.engine import example_file, intersecting_pairs, refuse_earlier_run
from clothsim.files import read_pattern
from clothsim.garments.dress.pipeline import FRICTION, SANK, descent_of_top, fallen, not_worn, slid_off, unrest
from clothsim.garments.dressed import EARLIER_NAMES, PATTERN_FILE, Dress, body_of_wearer, dress, short_name, surface_of
from clothsim.garments.inputs import BodyMesh, as_body_mesh, known_surface
from clothsim.garments.penetration import Counts, count_penetrations
from clothsim.garments.stages import Announcement, Listener, StageCallback, dress_drape, named_stage, simulate_stage
from transfer.errors import TransferError
from transfer.signed_distance import BodySurface
from transfer.wrap import TriangleMesh, wrap

CELL, LAYER = 0.01, 0.007
"""Lattice cell of a wrap, and its distance from the garments [m]: above half a cell, so that it sees every fold."""
GROWTH = 0.002
"""Growth of this distance where something reaches out of the wrap [m]."""
ROUNDS = 5
"""Bound on the wraps that are tried."""
SAME = 1e-6
"""Largest distance of corresponding vertices of one body in two files [m]."""


@dataclass(frozen=True)
class Worn:
    """A garment as it is worn: its cloth at its positions, and the tables of `[effects.seams]` that are not welded."""

    cloth: Cloth
    seams: tuple[Mapping[str, Any], ...] = ()

    @property
    def name(self) -> str:
        """Name of the garment."""
        return str(self.cloth.name)

    @property
    def positions(self) -> Floats:
        """Vertices (n, 3) [m]."""
        return np.asarray(self.cloth.vertices, np.float64)

    @property
    def triangles(self) -> Ints:
        """Triangles (m, 3)."""
        return np.asarray(self.cloth.triangles, np.int64)

    def moved_to(self, positions: Floats) -> "Worn":
        """Copy at other positions (n, 3) [m]."""
        return replace(self, cloth=replace(self.cloth, vertices=positions))


@dataclass(frozen=True)
class Outfit:
    """Result of `outfit`.

    Attributes
    ----------
    directory : Path
        Directory of the run of all garments, with a folder for each garment that was sewn.
    status : str
        "completed" (all garments rest on the body, free of intersections), "sewn" (they still move at the end of the
        common drape) or "failed".
    reason : str
        Reason for the status, one sentence.
    body : BodyMesh
        Body that wears them.
    worn : tuple of Worn
        Final garments, the innermost first, including those of the run that they were sewn over.
    sewn : tuple of Dress
        Garments that were sewn, each on the body and a wrap of the garments below it.
    run : Run or None
        Drape of all garments; None if none was started.
    counts : Counts or None
        Penetration counts of all garments together by the exact check; None without a drape.
    notes : tuple of str
        Defaults used, and remarks.
    """

    directory: Path
    status: str
    reason: str
    body: BodyMesh
    worn: tuple[Worn, ...]
    sewn: tuple[Dress, ...]
    run: Run | None
    counts: Counts | None
    notes: tuple[str, ...]


@renamed(**EARLIER_NAMES)
def outfit(
    patterns: Sequence[str | Path | Pattern],
    on: str | Path | Any = None,
    output: str | Path | None = None,
    *,
    over: str | Path | None = None,
    scale: float | None = None,
    body_group: str | Sequence[str] | None = None,
    overwrite: bool = False,
    on_stage: StageCallback = lambda stage: None,
    progress: Listener | None = None,
    announce: Announcement | None = None,
    **settings: Any,
) -> Outfit:
    """Sew patterns one over another on a body, and drape all garments together.

    Parameters
    ----------
    patterns : sequence of str, Path or Pattern
        Sewing patterns as in `dress`, the innermost garment first.
    on : str, Path, Body or mesh object, optional
        The body, as in `dress`; None: that of `over`.
    output : str or Path, optional
        Directory for the run of all garments, with a folder for each; None: a new temporary one.
    over : str or Path, optional
        Directory of a completed run of `dress` or `outfit`. Its garments lie below those of the patterns.
    scale, body_group
        Unit and group of the body's file, as in `dress`.
    overwrite : bool
        True: replace an earlier run in the directory.
    on_stage, progress, announce : callable, optional
        As in `dress`; `announce` is for the drape of all garments.
    **settings
        size, fabric, waistband and other arguments of `dress`, for each of the patterns; a budget is that of each, and
        of the drape of all.

    Returns
    -------
    Outfit
        Its status is "completed", "sewn" (the garments still move at the end of the common drape), or "failed".

    Raises
    ------
    InputError
        Invalid files or arguments, two garments with the same name, a run that did not complete, or a run with another
        body.

    Examples
    --------
    >>> import clothsim
    >>> clothsim.outfit(["trousers.json", "shirt.json"], on="body.obj", output="worn").status  # doctest: +SKIP
    'completed'
    """
    patterns = _patterns(patterns, settings)
    body, worn = _wearer(on, over, scale, body_group)
    names = _names(patterns, [each.name for each in worn])
    if output is None:
        directory = Path(tempfile.mkdtemp(prefix="clothsim-outfit-"))
    else:
        directory = Path(output)
        refuse_earlier_run(directory, overwrite, (), (on, over, *patterns))
    make_directory(directory)
    surface = surface_of(body)
    sewn: list[Dress] = []
    notes = list(body.notes)
    end = Outfit(directory, "failed", "", body, (), (), None, None, ())
    for pattern, name in zip(patterns, names, strict=True):
        below = [(each.positions, each.triangles) for each in worn]
        wearer = wrapped(body, surface, below) if below else body
        own: dict[str, Any] = {"overwrite": overwrite, "on_stage": on_stage, "progress": named_stage(name, progress)}
        sewn.append(dress(pattern, wearer, directory / name, **own, **settings))
        notes += [f"{name}: {note}" for note in sewn[-1].notes if note not in body.notes]
        if not sewn[-1].draped or sewn[-1].run is None:
            reason = f"{name}, over {worn[-1].name}" if worn else name
            reason = f"{reason}: {sewn[-1].reason}"
            return _written(replace(end, reason=reason, worn=worn, sewn=tuple(sewn), notes=tuple(notes)))
        worn = (*worn, *worn_in(sewn[-1].run, name))
    end = replace(end, worn=worn, sewn=tuple(sewn), notes=tuple(notes))
    try:
        ends = process_time() + (settings.get("budget") or np.inf)
        run = draped_together(worn, body, directory, progress, announce, ends)
    except InputError as error:
        return _written(replace(end, reason=f"The drape of all could not start: {error.sentence}"))
    if run.status != "completed":
        return _written(replace(end, run=run, reason=f"In the drape of all: {run.reason}"))
    return _written(_judged(end, run, surface, settings))


def _patterns(patterns: Sequence[str | Path | Pattern], settings: Mapping[str, Any]) -> list[Path | Pattern]:
    """Files of patterns, and those in memory. InputError for one that cannot be read, before the first is sewn."""
    if isinstance(patterns, str | Path | Pattern):
        raise InputError("patterns is one pattern.", "Give a list, the innermost garment first: [trousers, shirt].")
    if not isinstance(patterns, Iterable):
        raise InputError(f"patterns is of the type {type(patterns).__name__}.", "Give a list of files or Patterns.")
    listed = list(patterns)
    for each in listed:
        if not isinstance(each, str | Path | Pattern):
            raise InputError(f"A pattern is of the type {type(each).__name__}.", "Give files or Patterns.")
    found = [example_file(each, "_specification.json", PATTERN_FILE) for each in listed]
    reading = {key: settings[key] for key in ("rotation_order", "seams") if key in settings}
    for each in found:
        if not isinstance(each, Pattern):
            read_pattern(each, **reading)
    return found


def _wearer(
    on: Any, over: str | Path | None, scale: float | None, body_group: str | Sequence[str] | None
) -> tuple[BodyMesh, tuple[Worn, ...]]:
    """The body and the garments that it wears. InputError for neither, and for a run that cannot be sewn over."""
    given = None if on is None else body_of_wearer(on, scale, body_group)
    if over is None:
        if given is None:
            raise InputError("There is no body.", "Give it (--on BODY), or a run to sew over (--over RUN).")
        return given, ()
    run = open_run(over)
    if run.status != "completed":
        what = f"The run {over} did not complete ({run.status}): {run.reason}"
        raise InputError(what, "Sew over a run that completed.")
    scene = run.scene
    if len(scene.bodies) != 1:
        raise InputError(f"The run {over} has {len(scene.bodies)} bodies.", "Sew over a run with one body.")
    (_, positions, triangles), *_ = run.bodies(-1)
    body = replace(as_body_mesh(Body(positions, triangles)), name="the body")
    if given is not None:
        if given.positions.shape != body.positions.shape or np.abs(given.positions - body.positions).max() > SAME:
            raise InputError(
                f"The garments of {over} are on another body than {given.name}.", "Leave out --on, or give that body."
            )
        body = given
    summary = read_summary(run.directory / SUMMARY_NAME)
    return body, worn_in(run, str(summary.get("pattern", run.directory.name)))


def _names(patterns: Sequence[str | Path | Pattern], taken: Sequence[str]) -> list[str]:
    """Name of the garment of each pattern. InputError for no pattern, and for a name that is there twice."""
    if not patterns:
        raise InputError("The outfit has no pattern.", "Give one or more.")
    found = [*taken]
    for number, pattern in enumerate(patterns):
        name = f"pattern{number}" if isinstance(pattern, Pattern) else short_name(pattern)
        if name in found:
            raise InputError(f"The outfit has the garment {name} twice.", "Name each once, or copy its file.")
        found.append(name)
    return found[len(taken) :]


def worn_in(run: Run, name: str) -> tuple[Worn, ...]:
    """Garments of a run at its end; name: of the garment of a run of one.

    InputError for a garment that is not of arrays, as those that `dress` sews are.
    """
    scene, last = run.scene, run[-1].positions
    found = []
    for cloth in scene.cloths:
        own = str(cloth.name)
        keys = {key: value for key, value in dict(cloth).items() if key not in ("mesh", "name")}
        mesh = cloth["mesh"]
        if isinstance(mesh, str) or set(keys) & {"position", "rotation_degrees", "scale", "weld", "cells"}:
            raise InputError(f"{own} in {run.directory} is not of `clothsim dress`.", "Sew over one that is.")
        called = name if len(scene.cloths) == 1 else own
        rest = mesh.vertices if mesh.rest is None else mesh.rest
        made = Cloth(last[own], mesh.triangles, rest=rest, groups=mesh.groups or None, name=called, **keys)
        seams = []
        for seam in scene.effects["seams"].seam if "seams" in scene.effects else ():
            lines = {side: dict(seam[side]) for side in ("from", "to")}
            if lines["from"].get("cloth") in (None, own):
                seams.append({**dict(seam), **{side: {**line, "cloth": called} for side, line in lines.items()}})
        found.append(Worn(made, tuple(seams)))
    return tuple(found)


def draped_together(
    worn: Sequence[Worn],
    body: BodyMesh,
    folder: Path,
    listener: Listener | None,
    announce: Announcement | None,
    ends: float = np.inf,
) -> Run:
    """Run of all garments on the real body until they rest. InputError for a start that cannot be simulated."""
    seams = [seam for each in worn for seam in each.seams]
    scene = dress_drape(body.up, seams, FRICTION).scene(
        cloth=[each.cloth for each in worn], body=Body(body.positions, body.triangles, name="body")
    )
    return simulate_stage(scene, folder, named_stage("drape of all garments", listener), announce, ends)


def _judged(end: Outfit, run: Run, surface: BodySurface, settings: Mapping[str, Any]) -> Outfit:
    """The outfit after a drape of all that completed: intersections, garments that are not worn, motion."""
    worn, body = end.worn, end.body
    counts = count_penetrations(run.positions(-1), run.triangles, surface)
    last = tuple(each.moved_to(run[-1].positions[each.name]) for each in worn)
    sinking = [
        f"{before.name} sank by {1e3 * down:.0f} mm when all garments were draped"
        for before, after in zip(worn, last, strict=True)
        if (down := descent_of_top(before.positions, after.positions, body.up)) > SANK * body.height
    ]
    names, moving = ", ".join(each.name for each in worn), unrest(run, body.name)
    status, reason = "completed", f"{len(worn)} garments rest on {body.name}: {names}."
    if moving:
        status, reason = "sewn", f"{len(worn)} garments are {moving}: {names}."
    if not counts.clean:
        status, reason = "failed", f"The drape of all ended with {counts}, {counts.where}."
    elif fault := _not_worn(worn, last, end.sewn, body, settings):
        status, reason = "failed", f"In the drape of all: {fault}"
    notes = (*end.notes, *sinking)
    return replace(end, status=status, reason=reason, worn=last, run=run, counts=counts, notes=notes)


def _not_worn(
    worn: Sequence[Worn], last: Sequence[Worn], sewn: Sequence[Dress], body: BodyMesh, settings: Mapping[str, Any]
) -> str:
    """Why a garment is not worn after the drape of all, in a sentence with its name; empty where all are."""
    waistband = bool(settings.get("waistband", False))
    states = {each.directory.name: each.state for each in sewn}
    for before, after in zip(worn, last, strict=True):
        fault = fallen(before.positions, after.positions, body)
        if before.name in states:
            fault = fault or not_worn(states[before.name].moved_to(after.positions), body, waistband)
        else:  # of an earlier run: worn where it was, and no waistband can be put in
            fault = fault or slid_off(before.positions, after.positions, body, waistband=True)
        if fault:
            return f"{before.name}: {fault}"
    return ""


def _written(done: Outfit) -> Outfit:
    """The outfit, with its summary written."""
    file = done.directory / SUMMARY_NAME
    previous = read_summary(file) if done.run is not None else {"failure": None, "certificate": None, "notes": []}
    entries: dict[str, Any] = {
        "status": done.status,
        "reason": done.reason,
        "garments": [each.name for each in done.worn],
        "sewn": {
            each.directory.name: {
                "status": each.status,
                "welded": len(each.state.welded),
                "seams": len(each.state.mesh.seams),
            }
            for each in done.sewn
        },
        "notes": [*done.notes, *previous["notes"]],
    }
    if done.status == "failed":
        failed = {"cause": "dress", "sentence": done.reason, "element": str(done.counts or ""), "position": None}
        alone = [each.directory for each in done.sewn[-1:] if not each.draped]  # else the drape of all failed
        remedy = f"Look at the pictures and the summary in {(*alone, done.directory)[0]}."
        entries["failure"] = {**failed, "remedy": remedy, **dict.fromkeys(("step", "time", "dt"))}
    write_summary(file, {**previous, **entries})
    return done


def wrapped(body: BodyMesh, surface: BodySurface, garments: Sequence[TriangleMesh]) -> BodyMesh:
    """The body and a wrap of the garments on it as one body of several pieces, with the landmarks of the body.

    Where it wears nothing it is as wide as without a wrap: a layer of 7 mm would make every sleeve 44 mm tighter.

    Raises
    ------
    InputError
        If the garments reach out of each wrap that was tried.
    """
    for number in range(ROUNDS):
        shell, triangles = wrap(surface, garments, LAYER + number * GROWTH, CELL)
        positions = np.concatenate([body.positions, shell])
        made = positions, np.concatenate([body.triangles, triangles + len(body.positions)])
        if _holds(made, garments):
            return BodyMesh(body.name, *made, body.scale, body.notes, body)
    raise InputError(
        f"No surface round the {len(garments)} garments on {body.name} holds them all.",
        "Look for cloth that is far from the body, or intersects it: `clothsim check`.",
    )


def _holds(made: TriangleMesh, garments: Sequence[TriangleMesh]) -> bool:
    """True if garments lie inside a body and its wrap: no vertex outside, no triangle through the outside."""
    positions, triangles = made
    try:
        outside = known_surface(positions, triangles)
    except TransferError:
        return False
    for points, faces in garments:
        if (outside.closest(points).signed_distance >= 0).any():
            return False
        both = np.concatenate([positions, points])
        if len(intersecting_pairs(both, outside.triangles[outside.outer], faces + len(positions))):
            return False
    return True
