"""`clothsim check` and `explain`: all faults of a mesh, a scene or a run; effects that are on, and their cost."""

import argparse
from itertools import zip_longest
from pathlib import Path
from typing import Any

import clothsim
from clothsim import engine, files, patterns, render
from clothsim.base.errors import InputError
from clothsim.base.text import length_text, text_table
from clothsim.cli import on_demand
from clothsim.cli.arguments import (
    add_output_options,
    add_overwrite,
    as_count,
    as_positive_number,
    as_range,
    as_scale,
    as_seconds,
    refuse_output,
)
from clothsim.cli.report import DONE, FAILED, Report

_DESCRIPTION = """\
Examine a mesh file, a scene, all frames of a run, a pattern, or a garment on a body. Exit code 1: something is wrong.

  clothsim check shirt.obj
  clothsim check suit.mhclo --on base.obj --body-group body -o suit.png
"""

PATTERNS = (".dxf", ".json")
SPACING = 0.02
"""Size of the mesh that a pattern is tried with [m]."""

WORN = 0.1
"""A garment farther from the body than this fraction of its size is not worn."""

_TARGETS = "Name a mesh file, a scene (.toml) or the directory that `clothsim run SCENE -o DIR` wrote."


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
    mesh.add_argument("--scale", metavar="S", help="metres per unit of the file")
    mesh.add_argument("--group", metavar="NAME", help="only this group of the file")
    mesh.add_argument("--component", metavar="N", help="only this piece, 0 the largest")
    worn = check.add_argument_group("for a garment on a body (--scale then applies to both)")
    worn.add_argument("--on", type=Path, metavar="BODY", help="the body that wears it")
    worn.add_argument(
        "--body-group", action="append", metavar="NAME", help="this group of the body; repeat it for several"
    )
    worn.add_argument("--body-scale", metavar="S", help="metres per unit of the body")
    worn.add_argument("--part", metavar="LO:HI", help="only these vertices of MESH")
    worn.add_argument("--weld", metavar="M", help="sew borders closer than M [m]")
    worn.add_argument("-o", dest="output", type=Path, metavar="PNG", help="a picture that marks the faults")
    check.add_argument("--seams", type=Path, metavar="TOML", help="seams of a .dxf; -o draws the edge numbers")
    check.add_argument("--motion", action="store_true", help="for a scene: where parts of a moving body model meet")
    add_overwrite(check)
    add_output_options(check, json="as JSON: {target, code, findings, ...}", handler=_check)
    explain = commands.add_parser("explain", description=_EXPLAIN)
    explain.add_argument("target", type=Path, metavar="SCENE|DIR", help="a scene file (TOML), or a run")
    explain.add_argument("--steps", metavar="N", help="number of steps of a scene (default 5)")
    explain.add_argument("--absent", action="store_true", help="also measure the effects that a scene does not name")
    explain.add_argument("--budget", metavar="TIME", help="time for --absent: 90s, 10min (default 60s)")
    add_output_options(explain, json="the effects as JSON: {effect: {on, reason, seconds, ...}}", handler=_explain)


def _check(arguments: argparse.Namespace) -> Report:
    found = _examined(arguments)
    errors, warnings = found.of("error"), found.of("warning")
    document = {
        "target": str(arguments.target),
        "code": FAILED if errors else DONE,
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
    counts = ((len(errors), "error"), (len(warnings), "warning"))
    parts = [f"{n} {what}{'' if n == 1 else 's'}" for n, what in counts if n] or ["Nothing is wrong"]
    return Report(document, "\n".join([*lines, found.verdict or f"{' and '.join(parts)}."]), not errors)


def _examined(arguments: argparse.Namespace) -> "engine.Examination":
    """The examination of the target; InputError for options that do not go together."""
    target = engine.example_file(engine.example_file(arguments.target), "_specification.json")
    if not target.exists():
        raise InputError(f"There is no {target}.", _TARGETS)
    if arguments.output is not None:
        refuse_output(arguments.output, arguments, target, arguments.on, arguments.seams)
    if target.suffix.lower() in PATTERNS and arguments.on is None:
        return _examined_pattern(arguments, target)
    if arguments.seams is not None:
        raise InputError(f"{target} is not a DXF drawing.", "--seams is for those only.")
    is_mesh = not target.is_dir() and target.suffix != ".toml"
    if not is_mesh and (arguments.body or arguments.scale or arguments.group or arguments.component):
        raise InputError(
            f"{target} is not a mesh file.", "--body, --scale, --group and --component are for mesh files only."
        )
    of_pair = (arguments.body_group, arguments.body_scale, arguments.part, arguments.weld, arguments.output)
    if arguments.on is None and any(option is not None for option in of_pair):
        raise InputError("--body-group, --body-scale, --part, --weld and -o need --on.", "Name the body: --on BODY.")
    if arguments.on is not None:
        if arguments.body or arguments.group or arguments.component or not is_mesh:
            remedy = "Try --part LO:HI." if is_mesh else "Name the mesh of the garment first: GARMENT.obj --on BODY."
            raise InputError("--on is for a mesh file, without --body, --group and --component.", remedy)
        return _examined_penetration(arguments)
    if arguments.motion and target.suffix != ".toml":
        raise InputError(f"{target} is not a scene.", "--motion is for scenes with a body model.")
    if not is_mesh:
        return engine.examined(target, motion=arguments.motion)
    part: dict[str, Any] = {"group": arguments.group}
    if arguments.scale is not None:
        part["scale"] = as_scale("--scale", arguments.scale)
    if arguments.component is not None:
        part["component"] = 0 if arguments.component == "0" else as_count("--component", arguments.component)
    return engine.examined(target, "body" if arguments.body else None, **part)


def _examined_pattern(arguments: argparse.Namespace, target: Path) -> "engine.Examination":
    """The panels, edges and seams of a pattern, drawn with -o; an error where it cannot be meshed."""
    others = ("body", "scale", "group", "component", "body_group", "body_scale", "part", "weld", "motion")
    wrong = [f"--{name.replace('_', '-')}" for name in others if getattr(arguments, name)]
    if wrong:
        raise InputError(f"{target} is a sewing pattern: {wrong[0]} is not for those.", "--seams and -o are.")
    notes: list[str] = []
    findings: list[clothsim.Finding] = []
    try:
        without_sewing_file = target.suffix.lower() == ".dxf"
        pattern = files.read_pattern(target, seams=arguments.seams, sewn=not without_sewing_file)
        for name, panel in pattern.panels.items():
            width, height = panel.extent
            lengths = ", ".join(f"{edge}: {100 * panel.edge_length(edge):.1f}" for edge in range(len(panel.edges)))
            notes.append(f"{name}: {100 * width:.1f} x {100 * height:.1f} cm; edges [cm] {lengths}")
        for number, stitch in enumerate(pattern.stitches):
            first, second = (100 * pattern.panels[side.panel].edge_length(side.edge) for side in stitch.sides)
            notes.append(f"seam {number}: {stitch.first} to {stitch.second}, {first:.1f} and {second:.1f} cm")
        notes += pattern.notes
        if arguments.output is not None:
            drawn = render.draw_pattern(arguments.output, pattern, target.name, edge_numbers=True)
            notes.append(f"drawn: {drawn}")
        patterns.joined_vertices(patterns.mesh_pattern(pattern, SPACING))  # seams that give the garment one side
    except InputError as error:
        findings.append(clothsim.Finding("error", "pattern", error.sentence, error.remedy))
    return engine.Examination(f"{target}, as a sewing pattern", tuple(notes), tuple(findings))


def _examined_penetration(arguments: argparse.Namespace) -> "engine.Examination":
    """The examination of a garment on a body: an error where a vertex is inside or triangles intersect."""
    if not arguments.on.exists():
        raise InputError(f"There is no {arguments.on}.", "Name the file of a body.")
    report = on_demand.read_penetration_report(
        arguments.target,
        arguments.on,
        scale=as_scale("--scale", arguments.scale),
        body_scale=as_scale("--body-scale", arguments.body_scale),
        body_group=arguments.body_group,
        part=None if arguments.part is None else as_range("--part", arguments.part),
        weld=0.0 if arguments.weld is None else as_positive_number("--weld", arguments.weld),
    )
    entries = list(on_demand.entries(report))
    notes = [*report.notes, *(entry for entry in entries if isinstance(entry, str))]
    findings = [entry for entry in entries if not isinstance(entry, str)]
    if arguments.output is not None:
        try:
            notes.append(f"{arguments.output}: {on_demand.draw_penetrations(report, arguments.output)}")
        except OSError as error:
            raise InputError(
                f"{arguments.output} cannot be written ({error.strerror}).", "Choose another with -o."
            ) from error
    where = "" if report.counts.position is None else f", worst {report.counts.where}"
    verdict = f"Not clean: {report.counts}{where}."
    if report.counts.clean:
        nearest = float(report.closest.signed_distance.min())
        away = length_text(nearest)
        far = f"Nothing intersects, but the garment is {away} away from the body: give their units, --scale."
        verdict = "" if nearest <= WORN * report.body.size else far
    return engine.Examination(f"{arguments.target} on {arguments.on}", tuple(notes), tuple(findings), verdict)


_EXPLAIN = """\
List every effect of a run, or of a scene's first steps: on or off, the reason, and its cost.
With --absent also the cost of adding each effect that the scene does not name.

  clothsim explain scenes/sphere.toml --steps 5
  clothsim explain scenes/sphere.toml --absent --budget 2min
"""


def _explain(arguments: argparse.Namespace) -> Report:
    if arguments.target.is_dir():
        for option in ("steps", "absent", "budget"):
            if getattr(arguments, option):
                raise InputError(f"--{option} is for scenes.", "Leave it out for a run.")
        receipt = engine.explain(arguments.target)
    else:
        steps = 5 if arguments.steps is None else as_count("--steps", arguments.steps)
        budget = as_seconds("--budget", "60s" if arguments.budget is None else arguments.budget)
        if arguments.budget is not None and not arguments.absent:
            raise InputError("--budget is for --absent.", "Add --absent, or leave it out.")
        scene = clothsim.load_scene(arguments.target)
        receipt = engine.explain(scene, steps, budget if arguments.absent else None)
    return Report(dict(sorted(receipt.effects.items())), table(receipt))


def table(receipt: "engine.Receipt") -> str:
    """The receipt as text: effects that are on, phases, effects that are off, the cost of adding one."""
    absent = receipt.absent
    on = {name: entry for name, entry in receipt.effects.items() if entry["on"]}
    off = {name: entry for name, entry in receipt.effects.items() if not entry["on"]}
    shown = ("bytes", "idle_steps")  # columns that may be empty altogether
    columns = [key for key in _COLUMNS if key not in shown or any(entry.get(key) for entry in on.values())]
    rows = []
    for name, entry in on.items():
        counts = {key: entry.get(key, 0) for key in columns}
        counters = [f"{n / 1e3:,.1f}" if key == "bytes" else f"{n:,}" if n else "" for key, n in counts.items()]
        rows.append([name, *_time(entry["seconds"], receipt.seconds), *counters])
        for part, seconds in entry["parts"].items():
            rows.append([f"  of it {part}", *_time(seconds, receipt.seconds), *("" for _ in columns)])
    for name in sorted(receipt.phases, key=lambda name: -receipt.phases[name]):
        rows.append([f"({name})", *_time(receipt.phases[name], receipt.seconds), *("" for _ in columns)])
    rows.append(["all", *_time(receipt.seconds, receipt.seconds), *("" for _ in columns)])
    header = ["effect (phase)", "CPU s", "fraction", *(_COLUMNS[key] for key in columns)]
    lines = [f"Measured: {receipt.source}", "", text_table(header, rows)]
    left = {name: entry for name, entry in off.items() if absent is None or name not in absent.effects}
    if left:
        width = max(len(name) for name in left)
        reasons = {name: f"{effect['summary']}: {effect['reason']}" for name, effect in left.items()}
        lines += ["", "Off:", *(f"  {name:<{width}}  {reason}" for name, reason in reasons.items())]
    return "\n".join([*lines, *_added(receipt)])


def _added(receipt: "engine.Receipt") -> list[str]:
    """Lines with the cost of each effect that the scene does not name."""
    if (absent := receipt.absent) is None:
        return []
    measured = {name: each for name, each in absent.effects.items() if not each.why}
    others = {name: each for name, each in absent.effects.items() if each.why}
    lines = []
    if measured:
        rows = [
            [name, f"{each.seconds:.4f}", f"{each.ratio:.2f}", receipt.effects[name]["summary"]]
            for name, each in measured.items()
        ]
        rows.insert(0, ["(as it is)", f"{absent.seconds:.4f}", "1.00", ""])
        times = f"the first {absent.steps} step{'s' * (absent.steps > 1)}, median of {absent.rounds}"
        lines += ["", f"Not named; the cost of adding one ({times}):", ""]
        lines.append(text_table(["effect", "CPU s a step", "times as much", "meaning"], rows))
    if others:
        width = max(len(name) for name in others)
        lines += ["", "Not named, nor measured:", *(f"  {name:<{width}}  {each.why}" for name, each in others.items())]
    return lines


_COLUMNS = {
    "evaluations": "values",
    "gradients": "gradients",
    "hessians": "Hessians",
    "hessian_nonzeros": "non-zeros",
    "pairs": "pairs",
    "ccd_calls": "CCD calls",
    "bytes": "kB held",
    "idle_steps": "idle steps",
}


def _time(seconds: float, total: float) -> tuple[str, str]:
    return f"{seconds:.4f}", f"{100 * seconds / total:.1f} %" if total else ""
