"""`clothsim check`: all faults of a mesh, a scene or a run."""

import argparse
from itertools import zip_longest
from pathlib import Path
from typing import Any

from clothsim import engine
from clothsim.base.errors import InputError
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
        return engine.examined(target, motion=arguments.motion)
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
