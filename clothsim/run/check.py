"""Faults of a mesh, a scene or a run, all at once."""

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.base.text import length_text, many
from clothsim.files.characters.motion_check import MOST_DEGREES, closing_folds, fastest_turn, meetings
from clothsim.files.meshes.mesh_file import read_mesh
from clothsim.files.runs.checkpoint import CHECKPOINT_NAME, read_checkpoint
from clothsim.files.runs.trajectory import TRAJECTORY_NAME
from clothsim.geometry.intersection.crossings import Crossing
from clothsim.mesh.checks import Finding, Role, Severity, examine
from clothsim.mesh.world import world_surfaces
from clothsim.run.intersections import SURFACES_OF_KIND, IntersectionCheck, intersection_check_of, intersection_warnings
from clothsim.run.results import Run, open_run
from clothsim.scene.assembly.checks import size_doubts
from clothsim.scene.assembly.model_body import character_of_scene
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.cloth_arrays import Body, Cloth
from clothsim.scene.cost import CHEAPER, expected_cost
from clothsim.scene.mesh_objects import surface_of
from clothsim.scene.scene import Scene, scene_from_text
from clothsim.scene.toml_file import load_scene
from clothsim.solve.pinch.flypaper import exempted

NO_INDICES = np.zeros(0, np.int64)
MOST_TIMES = 600
"""Most times at which the motion of a body model is looked at."""

ALLOWED = {"carried": "vertices carried through a pinch", "excluded": "excluded pairs"}
"""Kinds of intersections that a scene allows."""
_NO_BODY_CONTACT = "[effects.body_contact] is not on: from a start without intersections it lets none arise"
_REASON = {
    "cloth_cloth": "[effects.self_contact] is not on: from a start without intersections it lets none arise",
    "cloth_body": _NO_BODY_CONTACT,
    "rigid": _NO_BODY_CONTACT,
    "excluded": "the scene excludes the pair from contact",
    "carried": "vertices of these triangles are carried through a pinch (contact.pinch)",
}


@dataclass(frozen=True)
class Examination:
    """What a check found.

    Parameters
    ----------
    subject : str
        What was examined.
    notes : tuple of str
        Sizes, settings that were chosen, and what was looked for and is not there.
    findings : tuple of Finding
        Errors first.
    verdict : str
        A last line; empty: the numbers of errors and warnings.
    """

    subject: str
    notes: tuple[str, ...]
    findings: tuple[Finding, ...]
    verdict: str = ""

    def of(self, severity: Severity) -> list[Finding]:
        """The errors, or the warnings."""
        return [finding for finding in self.findings if finding.severity == severity]


def check(what: Any, role: Role | None = None) -> list[Finding]:
    """Examine a mesh, the start of a scene, or the frames of a run.

    `clothsim check` prints the same findings. A scene is built, and its start is tested for intersections. An
    intersection there is an error if contact is on, since a run would refuse it; without contact it is a warning, as in
    a run. In the frames of a run, each intersection is an error unless the scene allows it.

    Parameters
    ----------
    what : Scene, Cloth, Body, mesh object, (vertices, triangles), str or Path
        A path names a scene (.toml), a mesh file or the directory of a run.
    role : {"cloth", "sewn cloth", "body"}, optional
        Use of a mesh; fewer faults matter in a body. None: a body for a `clothsim.Body`, else a cloth.

    Returns
    -------
    list of Finding
        Errors first; empty if there is no fault. Each has severity, kind, sentence, remedy and indices (of the
        vertices or triangles).

    Raises
    ------
    InputError
        If `what` is none of these, or its file cannot be read.

    Examples
    --------
    >>> import clothsim
    >>> square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    >>> clothsim.check((square, [[0, 1, 2], [0, 2, 3]]))
    []
    >>> [finding.kind for finding in clothsim.check((square, [[0, 1, 2], [2, 3, 9]]))]
    ['index out of range']
    """
    return list(examined(what, role).findings)


def examined(what: Any, role: Role | None = None, motion: bool = False, **part: Any) -> Examination:
    """The findings of `check` with notes.

    motion: of a scene file also where the parts of a moving body model meet; part: scale, group and component of a mesh
    file.
    """
    if isinstance(what, str | Path):
        if os.path.isdir(what):
            return _examine_run(Path(what))
        if Path(what).suffix.lower() == ".toml":
            found = _examine_scene_file(Path(what))
            return _add_motion(found, Path(what)) if motion and not found.of("error") else found
    if isinstance(what, Scene):
        return _examine_scene(what, "scene")
    name, vertices, triangles, usual, messages = _mesh_of(what, part)
    role = role or usual
    findings = [*examine(name, vertices, triangles, role).findings]
    try:
        notes = (*sizes(np.asarray(vertices, float), np.asarray(triangles, np.int64)), *messages)
    except (ValueError, TypeError, IndexError, OverflowError):  # of arrays that are not a mesh, which the findings say
        notes = messages
    else:
        findings += [_warning("size", doubt) for doubt in size_doubts(name, np.asarray(vertices, float))]
    article = "a body" if role == "body" else "a cloth"
    return Examination(
        f"{what if isinstance(what, str | Path) else name}, as {article}", notes, _sort_findings(findings)
    )


def sizes(positions: Floats, triangles: Ints) -> tuple[str, ...]:
    """Counts and lengths of a mesh, which may have faults; of a rod, which has no triangles, its size alone."""
    corners = positions[triangles]
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    box = " x ".join(f"{side:.3g}" for side in np.ptp(positions, axis=0))
    if not len(triangles):
        return (f"{len(positions):,} vertices", f"box {box} m")
    least, most, median = (length_text(float(each)) for each in (edges.min(), edges.max(), np.median(edges)))
    return (
        f"{len(positions):,} vertices, {len(triangles):,} triangles",
        f"box {box} m",
        f"edges {least} to {most}, median {median}",
    )


def _mesh_of(what: Any, part: dict[str, Any]) -> tuple[str, Any, Any, Role, tuple[str, ...]]:
    """Name, vertices, triangles and usual role of a mesh, and messages of its reader."""
    if isinstance(what, str | Path):
        mesh = read_mesh(what, **part)
        return Path(what).name, mesh.positions, mesh.triangles, "cloth", tuple(mesh.messages)
    if isinstance(what, Cloth):
        role: Role = "sewn cloth" if what.sewn or what.weld else "cloth"
        return what.name or "cloth", what.arrays.vertices, what.arrays.triangles, role, ()
    if isinstance(what, Body):
        return what.name or "body", what.arrays.vertices, what.arrays.triangles, "body", ()
    if isinstance(what, Sequence) and len(what) == 2:
        vertices, triangles = what
    else:
        vertices, triangles = surface_of("mesh", what)
    return "mesh", vertices, triangles, "cloth", ()


def _examine_scene_file(path: Path) -> Examination:
    """The examination of a scene file; what its text has wrong is a finding too, but not that it cannot be read."""
    if not os.path.isfile(path):
        raise InputError(f"There is no scene file {path}.")
    try:
        scene = load_scene(path)
    except InputError as error:
        return Examination(str(path), (), _refusals(error))
    return _examine_scene(scene, str(path))


def _add_motion(found: Examination, path: Path) -> Examination:
    """With the times at which parts of a body model meet, or a joint turns too far in a step."""
    entries = list(motion_findings(load_scene(path)))
    notes = (entry for entry in entries if isinstance(entry, str))
    more = (entry for entry in entries if not isinstance(entry, str))
    return replace(found, notes=(*found.notes, *notes), findings=_sort_findings([*found.findings, *more]))


COVERED = 0.03
"""Vertices of a body with cloth nearer than that are under it, as a fraction of its largest extent."""


def motion_findings(scene: Scene) -> Iterator[Finding | str]:
    """Findings and notes on the motion of the body model of a scene. InputError without one."""
    made, name = character_of_scene(scene)
    if made.timeline is None:
        yield f"{name} has no motion"
        return
    dt = scene.solver_settings.dt
    built = build(scene)
    contact: Any = built.energies.get("body_contact")
    end = min(scene.run_settings.duration, made.timeline.duration)
    steps = np.arange(0.0, end + dt / 2, dt)
    times = steps[:: -(-len(steps) // MOST_TIMES)]
    unit = float(np.cbrt(abs(np.linalg.det(made.linear))))
    gap = 0.0 if contact is None else contact.offset + 2 * contact.d_hat
    flypapered = scene.contact_settings.pinch == "carry"
    found = list(meetings(made.character, made.pose, times.tolist(), gap / unit))
    for met in found:
        place = ", ".join(f"{c:.3g}" for c in made.linear @ met.place + made.shift)
        when = f"from {met.start:.3g} to {met.end:.3g} s, at {met.times} of {len(times)} times"
        inside = met.nearest < 0
        what = "intersect" if inside else f"are nearer than {1e3 * gap:.3g} mm"
        size = f"{'depth' if inside else 'distance'} {1e3 * unit * abs(met.nearest):.3g} mm"
        yield Finding(
            "error" if inside and not flypapered else "warning",
            "motion",
            f"{name}: {' and '.join(met.parts)} {what} {when}; {size} at {met.at:.3g} s, ({place}) m",
            'contact.pinch = "carry" carries cloth through; motion.keep_apart = true turns the limbs outwards',
            NO_INDICES,
        )
    skin = made.character.vertices(made.pose(0.0)) @ made.linear.T + made.shift
    cloth = built.world.start()[: built.world.n_cloth] + built.world.origin
    covered = cKDTree(cloth).query(skin, workers=1)[0] < COVERED * np.ptp(skin, axis=0).max()
    folds = closing_folds(made.character, made.pose, times.tolist(), gap / unit, covered)
    for fold in folds:
        place = ", ".join(f"{c:.3g}" for c in made.linear @ fold.place + made.shift)
        yield Finding(
            "warning",
            "motion",
            f"{name}: the fold between {' and '.join(fold.parts)} closes on the cloth at {fold.vertices} of its "
            f"vertices, from {fold.start:.3g} to {fold.end:.3g} s; gap {1e3 * unit * fold.nearest:.3g} mm at "
            f"{fold.at:.3g} s, ({place}) m",
            'contact.pinch = "carry" carries cloth through; without it the run may stop there',
            NO_INDICES,
        )
    if not found:
        yield f"no parts of {name} come nearer than {1e3 * gap:.3g} mm, at {len(times)} times to {end:.3g} s"
    turn = fastest_turn(made.character, made.pose, steps.tolist())
    line = f"{turn.joint} turns by up to {turn.degrees:.3g} degrees in a step of {dt:g} s, at {turn.at:.3g} s"
    if not turn.steps:
        yield line
        return
    yield Finding(
        "warning",
        "motion",
        f"{name}: {line}; by more than {MOST_DEGREES:g} in {turn.steps} steps",
        "Contact follows a body along straight paths in a step: set solver.dt below "
        f"{dt * MOST_DEGREES / turn.degrees:.2g}",
        NO_INDICES,
    )


def _examine_scene(scene: Scene, subject: str) -> Examination:
    """The errors of building it, one a line; else what holds the cloth, what looks wrong and intersects at the start.

    One that is too large to be run is not built.
    """
    cost = expected_cost(scene)
    severity: Severity = "error" if cost.too_much else "warning"
    costly = [Finding(severity, "cost", f"Expected: {cost}.", CHEAPER, NO_INDICES) for _ in range(cost.notable)]
    if cost.too_much:
        return Examination(subject, (), tuple(costly))
    try:
        built = build(scene)
    except InputError as error:
        return Examination(subject, (), (*_refusals(error), *_refusals_of_meshes(scene, error), *costly))
    world = built.world
    notes = [
        f"{each.name}, {'cloth' if len(each.triangles) else 'rod'}: {'; '.join(sizes(each.positions, each.triangles))}"
        for each in world.cloths
    ]
    notes += [f"{each.name}, body: {'; '.join(sizes(each.positions, each.triangles))}" for each in world.bodies]
    notes += [*built.notes, *(f"{name} is off: {reason}." for name, reason in built.off.items())]
    test = intersection_check_of(world_surfaces(world), scene.effects, built.energies)
    start = [("at the start", test.crossings(world.start(), world.origin))]
    found, others = _intersections(test, start, "at the start", of_run=False)
    doubts = [_warning("start", sentence) for sentence in built.warnings]
    return Examination(subject, (*notes, *others), _sort_findings([*found, *doubts, *costly]))


def _warning(kind: str, sentence: str) -> Finding:
    return Finding("warning", kind, sentence, "", NO_INDICES)


def _refusals(error: InputError) -> tuple[Finding, ...]:
    """The sentences of an error of a scene."""
    return tuple(Finding("error", "scene", each, error.remedy, NO_INDICES) for each in error.sentence.splitlines())


SOUND: Mapping[str, Any] = {"mesh": "rectangle", "cells": [1, 1]}
"""A cloth beside which a body is built alone."""


def _refusals_of_meshes(scene: Scene, first: InputError) -> Iterator[Finding]:
    """What is wrong with each cloth and body alone, but for what the `first` error says: that ends the building."""
    alone: list[tuple[Any, Any]] = [((cloth,), ()) for cloth in scene.cloths]
    alone += [(SOUND, (body,)) for body in scene.bodies]
    known = set(first.sentence.splitlines())
    for cloth, body in alone:
        try:
            build(Scene(cloth, body, effects={"inertia": {}, "membrane": {}}, directory=scene.directory))
        except InputError as error:
            yield from (finding for finding in _refusals(error) if finding.sentence not in known)
            known |= set(error.sentence.splitlines())


def _examine_run(directory: Path) -> Examination:
    if not (directory / TRAJECTORY_NAME).is_file():
        raise InputError(
            f"{directory} is a directory without a run (no {TRAJECTORY_NAME}).",
            "Name a mesh file, a scene (.toml) or the directory that `clothsim run SCENE -o DIR` wrote.",
        )
    run = open_run(directory)
    frames_of_it = many(len(run.times), "frame")
    subject = f"{directory}: {run.status}, {frames_of_it}. {run.reason}"
    failed = []
    if run.status == "failed":
        remedy = (run.summary.get("failure") or {}).get("remedy", "")
        failed = [Finding("error", "run", f"The run failed: {run.reason}", remedy, NO_INDICES)]
    if not len(run.times):
        return Examination(subject, ("no frame",), tuple(failed))
    checkpoint = directory / CHECKPOINT_NAME
    effects = scene_from_text(read_checkpoint(checkpoint).scene_text).effects if checkpoint.is_file() else {}
    test = intersection_check_of(run.trajectory.surfaces, effects, effects)
    frames = ((f"in frame {k} at {time:g} s", _crossings(test, run, k)) for k, time in enumerate(run.times))
    found, notes = _intersections(test, frames, f"in any of {frames_of_it}", of_run=True)
    # what the certificate says of the steps between frames
    unseen = {kind: each for kind, each in run.intersections.items() if each["states"] and each["first_frame"] is None}
    between = [
        Finding(
            "warning" if kind in ALLOWED else "error", "intersection", f"between two frames, {sentence}", "", NO_INDICES
        )
        for kind, sentence in zip(unseen, intersection_warnings(unseen), strict=True)
    ]
    is_unknown = run.summary and run.intersection_free is None
    unknown = ["not all steps of the run were checked: what happened between its frames is not known"] * bool(
        is_unknown
    )
    of_contact = intersection_warnings(run.intersections)
    warnings = [each for each in run.summary.get("warnings") or () if isinstance(each, str)]
    others = [_warning("run", each) for each in warnings if each not in of_contact]
    return Examination(subject, (*notes, *unknown), _sort_findings([*failed, *found, *between, *others]))


def _crossings(test: IntersectionCheck, run: Run, frame: int) -> tuple[Crossing, ...]:
    """The intersections of a frame, those of vertices that are flypapered through a pinch apart."""
    found = test.crossings(np.concatenate([run.positions(frame), *(points for _, points, _ in run.bodies(frame))]))
    if not found or "carried" not in run.trajectory.fields:
        return found
    return exempted(found, test.surfaces, np.flatnonzero(run.field("carried", frame)))


def _intersections(
    test: IntersectionCheck, frames: Iterable[tuple[str, Sequence[Crossing]]], anywhere: str, of_run: bool
) -> tuple[list[Finding], list[str]]:
    """The intersections of frames, each (when, crossings), and notes on the kinds that are not there.

    Without the contact effect that would prevent it, only the first of a pair of surfaces is listed. Of a run each is
    an error; of a start those alone that contact refuses; what the scene allows is a warning.
    """
    listed: set[str] = set()
    kinds: list[str] = []
    found = []
    for when, crossings in frames:
        refused = {crossing.summary for crossing in test.violations(crossings)}
        for crossing in crossings:
            if crossing.summary in listed - refused:
                continue
            listed.add(crossing.summary)
            kinds.append(test.kind(crossing))
            prevented = crossing.summary in refused
            error = (of_run or prevented) and kinds[-1] not in ALLOWED
            remedy = "Move them apart, or let seed.untangle do it." if prevented else _REASON[kinds[-1]]
            remedy = (
                "" if prevented and of_run else remedy + "; later frames are not listed" * (of_run and not prevented)
            )
            count = f"{len(crossing.pairs):,} pair{'' if len(crossing.pairs) == 1 else 's'}"
            count += " of triangles" if set(crossing.parts) == {"triangle"} else ""
            sentence = f"{crossing.summary} {when}, in {count}: {crossing.sentence}"
            found.append(Finding("error" if error else "warning", "intersection", sentence, remedy, crossing.pairs))
    allowed = sorted({kind for kind in kinds if kind in ALLOWED})
    others = f", but for {' and '.join(ALLOWED[kind] for kind in allowed)}" if allowed else ""
    notes = [] if test.bodies or not test.cloths else ["no body, so nothing for cloth to intersect but itself"]
    absent = {"cloth_body": test.bodies and test.cloths, "cloth_cloth": test.cloths, "rigid": test.rigid}
    for kind, looked_for in absent.items():
        if looked_for and kind not in kinds:
            notes.append(f"{SURFACES_OF_KIND[kind]} do not intersect {anywhere}{others}")
    if test.rods and not found:
        notes.append(f"rods do not overlap {anywhere}, and no centre line goes through a triangle")
        notes.append("cloth within the radius of a rod is not looked for")
    return found, notes


def _sort_findings(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    return tuple(sorted(findings, key=lambda finding: finding.severity))
