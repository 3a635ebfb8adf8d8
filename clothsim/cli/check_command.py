"""`clothsim check`: all faults of a mesh, a scene or a run."""

import argparse
import contextlib
import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

from clothsim.base.errors import InputError
from clothsim.cli.arguments import as_count, as_positive_number
from clothsim.cli.pattern_command import PATTERNS, check_pattern
from clothsim.cli.penetration_command import check_penetration

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from clothsim import Run
    from clothsim.base.arrays import Floats, Ints
    from clothsim.engine import Crossing, IntersectionCheck

_DESCRIPTION = """\
Examine a mesh file, a scene, all frames of a run, a pattern, or a garment on a body. Exit code 1: something is wrong.

  clothsim check shirt.obj
  clothsim check jacket.dxf -o edges.svg
  clothsim check suit.mhclo --on base.obj --body-group body -o suit.png
"""

_TARGETS = "Name a mesh file, a scene (.toml) or the directory that `clothsim run SCENE -o DIR` left."


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    check = commands.add_parser(
        "check",
        usage="clothsim check [options] MESH|SCENE|DIR",
        description=_DESCRIPTION,
    )
    check.add_argument("target", type=Path, metavar="MESH|SCENE|DIR", help="a mesh file, a .toml, or a run")
    mesh = check.add_argument_group("for a mesh file, as in a scene")
    mesh.add_argument("--body", action="store_true", help="examine it as a body: fewer faults matter")
    mesh.add_argument("--scale", metavar="S", help="its numbers times S are metres")
    mesh.add_argument("--group", metavar="NAME", help="only this group of the file")
    mesh.add_argument("--component", metavar="N", help="only this piece, 0 the largest")
    worn = check.add_argument_group("for a garment on a body (--scale is then of both)")
    worn.add_argument("--on", type=Path, metavar="BODY", help="the body that wears it")
    worn.add_argument("--body-group", metavar="NAME", help="this group of the body")
    worn.add_argument("--body-scale", metavar="S", help="its numbers times S are metres")
    worn.add_argument("--part", metavar="LO:HI", help="only these vertices of MESH")
    worn.add_argument("--weld", metavar="M", help="sew borders closer than that [m]")
    worn.add_argument("-o", dest="output", type=Path, metavar="PNG", help="a picture with the bad places marked")
    check.add_argument("--seams", type=Path, metavar="TOML", help="of a .dxf: its seams; -o draws the numbers of edges")
    check.add_argument("--motion", action="store_true", help="of a scene: where parts of a moving body model meet")
    check.add_argument("--json", action="store_true", help="as JSON: {target, code, errors, warnings, notes}")
    check.add_argument("--debug", action="store_true", help="show tracebacks")
    check.set_defaults(handler=_reported)


def _reported(arguments: argparse.Namespace) -> int:
    """Print the lines of the check, or with --json one document of them."""
    if not arguments.json:
        return _check(arguments)
    text = io.StringIO()
    with contextlib.redirect_stdout(text):
        code = _check(arguments)
    found: dict[str, list[str]] = {"errors": [], "warnings": [], "notes": []}
    for line in text.getvalue().splitlines()[1:-1]:  # the first names the target, the last sums up
        severity, _, sentence = line.strip().partition(": ")
        kind = f"{severity}s" if severity in ("error", "warning") else "notes"
        found[kind].append(sentence if kind != "notes" else line.strip())
    from clothsim.base.safe_files.record import to_json

    print(to_json({"target": str(arguments.target), "code": code, **found}))
    return code


def _check(arguments: argparse.Namespace) -> int:
    from clothsim.engine import installed_scene, refuse_ending_of_installed

    target = arguments.target
    refuse_ending_of_installed(target)
    if not target.exists():
        target = installed_scene(target) or target
    if not target.exists():
        raise InputError(f"There is no {target}.", _TARGETS)
    if target.suffix.lower() in PATTERNS and arguments.on is None:
        return check_pattern(arguments)
    if arguments.seams is not None:
        raise InputError(f"{target} is no DXF drawing.", "--seams is for those only.")
    mesh_options = arguments.body or arguments.scale or arguments.group or arguments.component
    if mesh_options and (target.is_dir() or target.suffix == ".toml"):
        raise InputError(
            f"{target} is no mesh file.", "--body, --scale, --group and --component are for mesh files only."
        )
    of_pair = (arguments.body_group, arguments.body_scale, arguments.part, arguments.weld, arguments.output)
    if arguments.on is None and any(option is not None for option in of_pair):
        raise InputError("--body-group, --body-scale, --part, --weld and -o need --on.", "Name the body: --on BODY.")
    if arguments.on is not None:
        if arguments.body or arguments.group or arguments.component or target.is_dir() or target.suffix == ".toml":
            raise InputError("--on is for a mesh file, without --body, --group and --component.", "Try --part LO:HI.")
        return check_penetration(arguments)
    if arguments.motion and target.suffix != ".toml":
        raise InputError(f"{target} is no scene.", "--motion is for scenes with a body model.")
    if target.is_dir():
        return _check_run(target)
    if target.suffix == ".toml":
        return _check_scene(target, arguments.motion)
    return _check_mesh(target, arguments)


def _check_mesh(path: Path, arguments: argparse.Namespace) -> int:
    from clothsim.engine import examine
    from clothsim.files import read_mesh

    part: dict[str, Any] = {"group": arguments.group}
    if arguments.scale is not None:
        part["scale"] = as_positive_number("--scale", arguments.scale)
    if arguments.component is not None:
        part["component"] = 0 if arguments.component == "0" else as_count("--component", arguments.component)
    mesh = read_mesh(path, **part)
    report = examine(path.name, mesh.positions, mesh.triangles, "body" if arguments.body else "cloth")
    print(f"{path}, as a {'body' if arguments.body else 'cloth'}")
    for line in (*_sizes(mesh.positions, mesh.triangles), *mesh.messages):
        print(f"  {line}")
    for finding in sorted(report.findings, key=lambda finding: finding.severity):
        print(f"  {finding.severity}: {finding.sentence}\n    {finding.remedy}")
    print(_result(len(report.errors), len(report.warnings)))
    return 1 if report.errors else 0


def _check_scene(path: Path, motion: bool = False) -> int:
    from clothsim import load_scene
    from clothsim.engine import build, expected_cost, intersection_check_of, refuse_costly, world_surfaces

    print(path)
    try:
        scene = load_scene(path)
        cost = expected_cost(scene)
        refuse_costly(scene)
        if cost.notable:
            print(f"  warning: expected: {cost}")
        built = build(scene)
    except InputError as error:
        for sentence in error.sentence.splitlines():
            print(f"  error: {sentence}")
        if error.remedy:
            print(f"    {error.remedy}")
        print(_result(len(error.sentence.splitlines()), 0))
        return 1
    world = built.world
    for cloth in world.cloths:
        print(f"  {cloth.name}, cloth: {'; '.join(_sizes(cloth.positions, cloth.triangles))}")
    for body in world.bodies:
        print(f"  {body.name}, body: {'; '.join(_sizes(body.positions, body.triangles))}")
    for note in built.notes:
        print(f"  {note}")
    for name, reason in built.off.items():
        print(f"  {name} is off: {reason}.")
    check = intersection_check_of(world_surfaces(world), scene.effects, built.energies)
    errors, warnings = _intersections(
        check, [("at the start", check.crossings(world.start() + world.origin))], "at the start"
    )
    if motion:
        from clothsim.cli.motion_report import report_motion

        more = report_motion(scene, built.energies)
        errors, warnings = errors + more[0], warnings + more[1]
    return _ended(errors, warnings)


def _check_run(directory: Path) -> int:
    from clothsim import open_run
    from clothsim.engine import intersection_check_of, scene_from_text
    from clothsim.files import CHECKPOINT_NAME, TRAJECTORY_NAME, read_checkpoint

    if not (directory / TRAJECTORY_NAME).is_file():
        raise InputError(f"{directory} is a directory without a run (no {TRAJECTORY_NAME}).", _TARGETS)
    run = open_run(directory)
    print(f"{directory}: {run.status}, {len(run.times)} frames. {run.reason}")
    failed = run.status == "failed"
    if not len(run.times):
        print("  no frame")
        return _ended(int(failed))
    checkpoint = directory / CHECKPOINT_NAME
    effects = scene_from_text(read_checkpoint(checkpoint).scene_text).effects if checkpoint.is_file() else {}
    check = intersection_check_of(run.trajectory.surfaces, effects, effects)
    frames = ((f"in frame {k} at {time:g} s", _crossings(check, run, k)) for k, time in enumerate(run.times))
    errors, warnings = _intersections(
        check, frames, f"in any of {len(run.times)} frames", "; later frames are not listed"
    )
    between, excluded = _between_frames(run)
    return _ended(errors + between + failed, warnings + excluded)


def _crossings(check: "IntersectionCheck", run: "Run", frame: int) -> "tuple[Crossing, ...]":
    """The intersections of a frame, those of vertices that are carried through a pinch apart."""
    import numpy as np

    found = check.crossings(np.concatenate([run.positions(frame), *(points for _, points, _ in run.bodies(frame))]))
    if not found or "carried" not in run.trajectory.fields:
        return found
    from clothsim.engine import exempted

    return exempted(found, check.surfaces, np.flatnonzero(run.field("carried", frame)))


def _between_frames(run: "Run") -> tuple[int, int]:
    """Print what the certificate says of the steps between frames; returns the numbers of errors and warnings."""
    from clothsim.engine import intersection_warnings

    unseen = {kind: each for kind, each in run.intersections.items() if each["states"] and each["first_frame"] is None}
    for kind, sentence in zip(unseen, intersection_warnings(unseen), strict=True):
        print(f"  {_severity(kind)}: between two frames, {sentence}")
    if run.summary and run.intersection_free is None:
        print("  not all steps of the run were checked: what happened between its frames is not known")
    allowed = len(_ALLOWED.keys() & set(unseen))
    return len(unseen) - allowed, allowed


def _intersections(
    check: "IntersectionCheck",
    frames: "Iterable[tuple[str, Sequence[Crossing]]]",
    anywhere: str,
    note: str = "",
) -> tuple[int, int]:
    """Print the intersections of frames, each (when, found); returns the numbers of errors and warnings.

    Every intersection is an error, but for one that the scene allows (an excluded pair, contact.pinch): a warning.
    Without the contact effect that would prevent it, only the first of a pair of surfaces is listed; note: of that.
    """
    listed: set[str] = set()
    kinds: list[str] = []
    for when, found in frames:
        required = {crossing.summary for crossing in check.violations(found)}
        for crossing in found:
            if crossing.summary in listed - required:
                continue
            listed.add(crossing.summary)
            kinds.append(check.kind(crossing))
            count = f"{len(crossing.pairs):,} pair{'' if len(crossing.pairs) == 1 else 's'} of triangles"
            print(f"  {_severity(kinds[-1])}: {crossing.summary} {when}, in {count}: {crossing.sentence}")
            if crossing.summary not in required:
                print(f"    {_REASON[kinds[-1]]}{note}")
    allowed = [kind for kind in kinds if kind in _ALLOWED]
    others = f", but for {' and '.join(_ALLOWED[kind] for kind in sorted(set(allowed)))}" if allowed else ""
    if not check.bodies:
        print("  no body, so nothing for cloth to intersect but itself")
    elif "cloth_body" not in kinds:
        print(f"  cloth and body do not intersect {anywhere}{others}")
    if "cloth_cloth" not in kinds:
        print(f"  cloth and cloth do not intersect {anywhere}{others}")
    if check.rigid and "rigid" not in kinds:
        print(f"  rigid bodies and bodies do not intersect {anywhere}{others}")
    return len(kinds) - len(allowed), len(allowed)


def _severity(kind: str) -> str:
    return "warning" if kind in _ALLOWED else "error"


_ALLOWED = {"carried": "vertices carried through a pinch", "excluded": "excluded pairs"}
"""Kinds of intersections that a scene allows."""


_REASON = {
    "cloth_cloth": "[effects.self_contact] is not on: from a start without intersections it lets none arise",
    "cloth_body": "[effects.body_contact] is not on: from a start without intersections it lets none arise",
    "excluded": "the scene excludes the pair from contact",
    "rigid": "[effects.body_contact] is not on: from a start without intersections it lets none arise",
    "carried": "vertices of these triangles are carried through a pinch (contact.pinch)",
}


def _sizes(positions: "Floats", triangles: "Ints") -> list[str]:
    """Counts and lengths of a mesh, which may have faults."""
    import numpy as np

    corners = positions[triangles]
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    box = " x ".join(f"{side:.3g}" for side in np.ptp(positions, axis=0))
    return [
        f"{len(positions):,} vertices, {len(triangles):,} triangles",
        f"box {box} m",
        f"edges {1e3 * edges.min():.3g} to {1e3 * edges.max():.3g} mm, median {1e3 * np.median(edges):.3g} mm",
    ]


def _ended(errors: int, warnings: int = 0) -> int:
    print(_result(errors, warnings))
    return 1 if errors else 0


def _result(errors: int, warnings: int) -> str:
    if not errors and not warnings:
        return "Nothing is wrong."
    parts = [f"{n} {what}{'' if n == 1 else 's'}" for n, what in ((errors, "error"), (warnings, "warning")) if n]
    return f"{' and '.join(parts)}."
