"""`clothsim sweep`: a scene with some keys at each of some values."""

import argparse
import sys
from pathlib import Path
from typing import Any

import clothsim
from clothsim import engine
from clothsim.base.errors import InputError
from clothsim.base.text_table import text_table
from clothsim.cli import on_demand
from clothsim.cli.farm_command import terminated_like_interrupted
from clothsim.cli.report import Report

_DESCRIPTION = """\
Run a scene with every combination of the values of some keys, and list the verdicts: a farm in one process.

  clothsim sweep sphere --vary cloth.fabric=cotton,denim --vary solver.dt=.02,.01 -o sweep

A stopped sweep goes on; `clothsim farm work DIR` helps it from another process.
"""


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    sweep = commands.add_parser("sweep", description=_DESCRIPTION)
    sweep.add_argument("scene", type=Path, metavar="SCENE", help="a scene file (TOML), or the name of an example")
    sweep.add_argument("--vary", action="append", default=[], metavar="KEY=A,B,C", help="a key and its values")
    sweep.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="change a key of all")
    sweep.add_argument("-o", "--output", type=Path, metavar="DIR", help="folder (default: the scene's name_sweep)")
    sweep.add_argument("--quiet", action="store_true", help="print nothing but errors")
    sweep.add_argument("--json", action="store_true", help="print the rows as JSON")
    sweep.add_argument("--debug", action="store_true", help="show tracebacks")
    sweep.set_defaults(handler=_sweep)


def _sweep(arguments: argparse.Namespace) -> Report | int:
    if not arguments.vary:
        raise InputError("Nothing varies.", "Write --vary solver.dt=.02,.01.")
    scene = clothsim.load_scene(arguments.scene)
    for assignment in arguments.set:
        scene = engine.override(scene, assignment)
    varied = dict(_values(text) for text in arguments.vary)
    recipe = on_demand.make_recipe(scene, {"until": scene.run_settings.until}, {}, varied)
    on_demand.refuse_unbuildable(recipe)
    farm = on_demand.plan(recipe, arguments.output or Path(f"{arguments.scene.stem}_sweep"))
    with terminated_like_interrupted():
        try:
            on_demand.work(farm)
        except KeyboardInterrupt:
            print(f"Stopped: the same command, or `clothsim farm work {farm.directory}`, goes on.", file=sys.stderr)
            return 130
    rows = on_demand.write_manifest(farm)
    code = 0 if all(row["usable"] for row in rows) else 1
    return Report({"directory": str(farm.directory), "drapes": rows}, _table(rows), code)


def _values(text: str) -> tuple[str, Any]:
    """Key and grid of "solver.dt=.02,.01"; each value is read as a number where it is one."""
    key, equals, values = text.partition("=")
    given = [part.strip() for part in values.split(",") if part.strip()]
    if not equals or not given:
        raise InputError(f"--vary {text!r} names no values.", "Write --vary solver.dt=.02,.01.")
    return key.strip(), {"grid": [_number(part) for part in given]}


def _number(text: str) -> Any:
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return {"true": True, "false": False}.get(text, text)


def _table(rows: list[dict[str, Any]]) -> str:
    keys = list(rows[0]["parameters"])
    lines = [
        [
            *(str(row["parameters"][key]) for key in keys),
            "certified" if row["usable"] else row["cause"],
            f"{row['newton_iterations'] or 0}",
            f"{row['cpu_seconds'] or 0.0:.1f}",
            row["id"],
        ]
        for row in rows
    ]
    return text_table([*keys, "verdict", "Newton", "CPU s", "drape"], lines)
