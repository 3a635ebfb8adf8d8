"""`clothsim explain`: which effects are on, and what each one costs."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from clothsim.cli.arguments import as_count
from clothsim.errors import InputError

if TYPE_CHECKING:
    from clothsim.explain import Receipt

_DESCRIPTION = """\
List every effect: on or off, why, and what it costs. Of a run, or of a scene's first steps.

  clothsim explain scenes/sphere.toml --steps 5
"""


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    explain = commands.add_parser("explain", help="which effects are on, and what they cost", description=_DESCRIPTION)
    explain.add_argument("target", type=Path, metavar="SCENE|DIR", help="a scene file (TOML), or a run")
    explain.add_argument("--steps", metavar="N", help="of a scene: how many to take (default 5)")
    explain.add_argument(
        "--json", action="store_true", help="the effects as JSON: {effect: {on, reason, seconds, ...}}"
    )
    explain.add_argument("--debug", action="store_true", help="show tracebacks")
    explain.set_defaults(handler=_explain)


def _explain(arguments: argparse.Namespace) -> int:
    from clothsim.explain import explain_run, explain_scene
    from clothsim.scene.toml import load_scene

    if arguments.target.is_dir():
        if arguments.steps is not None:
            raise InputError("--steps is for scenes.", "Leave it out: a run has taken its steps.")
        receipt = explain_run(arguments.target)
    else:
        steps = 5 if arguments.steps is None else as_count("--steps", arguments.steps)
        receipt = explain_scene(load_scene(arguments.target), steps)
    if arguments.json:
        from clothsim.io.record import to_json

        print(to_json(receipt.effects, indent=2))
    else:
        print(table(receipt))
    return 0


def table(receipt: "Receipt") -> str:
    """The receipt for people to read: effects that are on, phases, effects that are off."""
    from clothsim.scene.effects import EFFECTS
    from clothsim.study.text_table import text_table

    on = {name: entry for name, entry in receipt.effects.items() if entry["on"]}
    off = {name: entry for name, entry in receipt.effects.items() if not entry["on"]}
    rows = []
    for name, entry in on.items():
        counters = [f"{entry[key]:,}" if entry["evaluations"] else "" for key in _COUNTERS]
        rows.append([name, *_time(entry["seconds"], receipt.seconds), *counters])
        for part, seconds in entry["parts"].items():
            rows.append([f"  of it {part}", *_time(seconds, receipt.seconds), *("" for _ in _COUNTERS)])
    for name in sorted(receipt.phases, key=lambda name: -receipt.phases[name]):
        rows.append([f"({name})", *_time(receipt.phases[name], receipt.seconds), *("" for _ in _COUNTERS)])
    rows.append(["all", *_time(receipt.seconds, receipt.seconds), *("" for _ in _COUNTERS)])
    header = ["effect (phase)", "seconds", "share", *_COUNTERS.values()]
    lines = [f"Measured: {receipt.source}", "", text_table(header, rows)]
    if off:
        width = max(len(name) for name in off)
        lines += ["", "Off:", *(f"  {name:<{width}}  {EFFECTS[name].says}: {e['reason']}" for name, e in off.items())]
    return "\n".join(lines)


_COUNTERS = {
    "evaluations": "values",
    "gradients": "gradients",
    "hessians": "Hessians",
    "hessian_nonzeros": "non-zeros",
    "pairs": "pairs",
    "ccd_calls": "CCD calls",
}


def _time(seconds: float, total: float) -> tuple[str, str]:
    return f"{seconds:.4f}", f"{100 * seconds / total:.1f} %" if total else ""
