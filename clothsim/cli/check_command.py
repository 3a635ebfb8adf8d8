"""`clothsim check`: all faults of a mesh, a scene or a run."""

import argparse
from collections.abc import Iterator
from dataclasses import replace
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np

import clothsim
from clothsim import engine, files
from clothsim.base.errors import InputError
from clothsim.cli import on_demand
from clothsim.cli.arguments import as_count, as_positive_number
from clothsim.cli.pattern_command import PATTERNS, examined_pattern
from clothsim.cli.penetration_command import examined_penetration
from clothsim.cli.report import Report

_DESCRIPTION = """\
Examine a mesh file, a scene, all frames of a run, a pattern, or a garment on a body. Exit code 1: something is wrong.

  clothsim check shirt.obj
  clothsim check jacket.dxf -o edges.svg
  clothsim check suit.mhclo --on base.obj --body-group body -o suit.png
"""

MOST_TIMES = 600
"""Most times at which the motion of a body model is looked at."""

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
    check.add_argument("--json", action="store_true", help="as JSON: {target, code, findings, ...}")
    check.add_argument("--debug", action="store_true", help="show tracebacks")
    check.set_defaults(handler=_check)


def _check(arguments: argparse.Namespace) -> Report:
    found = _examined(arguments)
    errors, warnings = found.of("error"), found.of("warning")
    code = 1 if errors else 0
    document = {
        "target": str(arguments.target),
        "code": code,
        "errors": [finding.sentence for finding in errors],
        "warnings": [finding.sentence for finding in warnings],
        "notes": found.notes,
        "findings": [
            {key: getattr(finding, key) for key in ("severity", "kind", "sentence", "remedy")}
            for finding in found.findings
        ],
    }
    lines = [found.subject, *(f"  {note}" for note in found.notes)]
    for finding, following in zip_longest(found.findings, found.findings[1:]):
        lines.append(f"  {finding.severity}: {finding.sentence}")
        if finding.remedy and (following is None or following.remedy != finding.remedy):
            lines.append(f"    {finding.remedy}")
    return Report(document, "\n".join([*lines, found.verdict or _counts(len(errors), len(warnings))]), code)


def _examined(arguments: argparse.Namespace) -> "engine.Examination":
    """The examination of the target; InputError for options that do not go together."""
    target = engine.example_file(arguments.target)
    if not target.exists():
        raise InputError(f"There is no {target}.", _TARGETS)
    if target.suffix.lower() in PATTERNS and arguments.on is None:
        return examined_pattern(arguments)
    if arguments.seams is not None:
        raise InputError(f"{target} is no DXF drawing.", "--seams is for those only.")
    is_mesh = not target.is_dir() and target.suffix != ".toml"
    if not is_mesh and (arguments.body or arguments.scale or arguments.group or arguments.component):
        raise InputError(
            f"{target} is no mesh file.", "--body, --scale, --group and --component are for mesh files only."
        )
    of_pair = (arguments.body_group, arguments.body_scale, arguments.part, arguments.weld, arguments.output)
    if arguments.on is None and any(option is not None for option in of_pair):
        raise InputError("--body-group, --body-scale, --part, --weld and -o need --on.", "Name the body: --on BODY.")
    if arguments.on is not None:
        if arguments.body or arguments.group or arguments.component or not is_mesh:
            raise InputError("--on is for a mesh file, without --body, --group and --component.", "Try --part LO:HI.")
        return examined_penetration(arguments)
    if arguments.motion and target.suffix != ".toml":
        raise InputError(f"{target} is no scene.", "--motion is for scenes with a body model.")
    if not is_mesh:
        found = engine.examined(target)
        return _with_motion(found, target) if arguments.motion and not found.of("error") else found
    part: dict[str, Any] = {"group": arguments.group}
    if arguments.scale is not None:
        part["scale"] = as_positive_number("--scale", arguments.scale)
    if arguments.component is not None:
        part["component"] = 0 if arguments.component == "0" else as_count("--component", arguments.component)
    return engine.examined(target, "body" if arguments.body else None, **part)


def _counts(errors: int, warnings: int) -> str:
    if not errors and not warnings:
        return "Nothing is wrong."
    parts = [f"{n} {what}{'' if n == 1 else 's'}" for n, what in ((errors, "error"), (warnings, "warning")) if n]
    return f"{' and '.join(parts)}."


def _with_motion(found: "engine.Examination", path: Path) -> "engine.Examination":
    """With the times at which parts of a body model meet, or a joint turns too far in a step."""
    entries = list(_of_motion(clothsim.load_scene(path)))
    notes = tuple(entry for entry in entries if isinstance(entry, str))
    more = (entry for entry in entries if not isinstance(entry, str))
    findings = sorted([*found.findings, *more], key=lambda finding: finding.severity)
    return replace(found, notes=(*found.notes, *notes), findings=tuple(findings))


def _of_motion(scene: "clothsim.Scene") -> "Iterator[clothsim.Finding | str]":
    """Findings and notes on the motion of the body model of a scene. InputError without one."""
    made, name = on_demand.character_of_scene(scene)
    if made.timeline is None:
        yield f"{name} has no motion"
        return
    dt = scene.solver_settings.dt
    contact: Any = engine.build(scene).energies.get("body_contact")
    end = min(scene.run_settings.duration, made.timeline.duration)
    steps = np.arange(0.0, end + dt / 2, dt)
    times = steps[:: -(-len(steps) // MOST_TIMES)]
    unit = float(np.cbrt(abs(np.linalg.det(made.linear))))
    gap = 0.0 if contact is None else contact.offset + 2 * contact.d_hat
    carried, none = scene.contact_settings.pinch == "carry", np.zeros(0, np.int64)
    meetings = list(files.meetings(made.character, made.pose, times.tolist(), gap / unit))
    for met in meetings:
        place = ", ".join(f"{c:.3g}" for c in made.linear @ met.place + made.shift)
        when = f"from {met.start:.3g} to {met.end:.3g} s, at {met.times} of {len(times)} times"
        inside = met.nearest < 0
        what = "intersect" if inside else f"are nearer than {1e3 * gap:.3g} mm"
        size = f"{'depth' if inside else 'distance'} {1e3 * unit * abs(met.nearest):.3g} mm"
        yield clothsim.Finding(
            "error" if inside and not carried else "warning",
            "motion",
            f"{name}: {' and '.join(met.parts)} {what} {when}; {size} at {met.at:.3g} s, ({place}) m",
            'contact.pinch = "carry" carries cloth through; motion.keep_apart = true turns the limbs outwards',
            none,
        )
    if not meetings:
        yield f"no parts of {name} come nearer than {1e3 * gap:.3g} mm, at {len(times)} times to {end:.3g} s"
    turn = files.fastest_turn(made.character, made.pose, steps.tolist())
    line = f"{turn.joint} turns by up to {turn.degrees:.3g} degrees in a step of {dt:g} s, at {turn.at:.3g} s"
    if not turn.steps:
        yield line
        return
    yield clothsim.Finding(
        "warning",
        "motion",
        f"{name}: {line}; by more than {files.MOST_DEGREES:g} in {turn.steps} steps",
        "Contact follows a body along straight paths in a step: set solver.dt below "
        f"{dt * files.MOST_DEGREES / turn.degrees:.2g}",
        none,
    )
