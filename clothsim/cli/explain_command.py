"""`clothsim explain`: effects that are on, and their cost."""

import argparse
from pathlib import Path
from typing import Any

import clothsim
from clothsim import engine
from clothsim.base.errors import InputError
from clothsim.base.text import text_table
from clothsim.cli.arguments import add_output_options, as_count, as_seconds
from clothsim.cli.report import Report

_DESCRIPTION = """\
List every effect of a run, or of a scene's first steps: on or off, the reason, and its cost.
With --absent also the cost of adding each effect that the scene does not name.

  clothsim explain scenes/sphere.toml --steps 5
  clothsim explain scenes/sphere.toml --absent --budget 2min
"""


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    explain = commands.add_parser("explain", description=_DESCRIPTION)
    explain.add_argument("target", type=Path, metavar="SCENE|DIR", help="a scene file (TOML), or a run")
    explain.add_argument("--steps", metavar="N", help="number of steps of a scene (default 5)")
    explain.add_argument("--absent", action="store_true", help="also measure the effects that a scene does not name")
    explain.add_argument("--budget", metavar="TIME", help="time for --absent: 90s, 10min (default 60s)")
    add_output_options(explain, json="the effects as JSON: {effect: {on, reason, seconds, ...}}", handler=_explain)


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
        counters = [_number(key, entry.get(key, 0)) for key in columns]
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


def _number(key: str, count: float) -> str:
    if key == "bytes":
        return f"{count / 1e3:,.1f}"
    return f"{count:,}" if count else ""
