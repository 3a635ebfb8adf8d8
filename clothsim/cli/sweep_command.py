"""`clothsim sweep`: a scene with every combination of the values of some keys."""

import argparse
import contextlib
import re
import sys
import tomllib
from pathlib import Path
from typing import Any

from clothsim.base.errors import InputError
from clothsim.base.text import text_table
from clothsim.cli import on_demand
from clothsim.cli.arguments import add_output_options, add_set, scene_of
from clothsim.cli.farm_command import terminated_like_interrupted
from clothsim.cli.report import INTERRUPTED, Report

_SWEEP = """\
Run a scene with every combination of the values of some keys, and list the results: a farm in one process.

  clothsim sweep sphere --vary cloth.fabric=cotton,denim --vary solver.dt=0.02,0.01 -o sweep

The same command continues a stopped sweep; `clothsim farm work DIR` in another process shares the work.
"""

LISTS = "Commas separate values; a list is one: --vary cloth.cells=[8,8],[16,16]."


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    sweep = commands.add_parser("sweep", description=_SWEEP)
    sweep.add_argument("scene", type=Path, metavar="SCENE", help="a scene file (TOML), or the name of an example")
    sweep.add_argument("--vary", action="append", default=[], metavar="KEY=A,B,C", help="a key and its values")
    add_set(sweep, "change a key in all runs")
    sweep.add_argument("-o", "--output", type=Path, metavar="DIR", help="folder (default: SCENE_sweep)")
    add_output_options(sweep, json="print the rows as JSON", quiet="print nothing but errors", handler=_sweep)


def _sweep(arguments: argparse.Namespace) -> Report | int:
    if not arguments.vary:
        raise InputError("Nothing varies.", "Write --vary solver.dt=0.02,0.01.")
    scene = scene_of(arguments)
    varied = dict(_values(text) for text in arguments.vary)
    recipe = on_demand.make_recipe(scene, {"until": scene.run_settings.until}, {}, varied)
    try:
        on_demand.refuse_unbuildable(recipe)
    except InputError as error:
        raise InputError(error.sentence, f"{error.remedy} {LISTS}") from error
    farm = on_demand.plan(recipe, arguments.output or Path(f"{arguments.scene.stem}_sweep"))
    with terminated_like_interrupted():
        try:
            on_demand.work(farm)
        except KeyboardInterrupt:
            print(f"Stopped. The same command, or `clothsim farm work {farm.directory}`, continues.", file=sys.stderr)
            return INTERRUPTED
    rows = on_demand.write_manifest(farm)
    good = all(row["usable"] for row in rows)
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
    table = text_table([*keys, "verdict", "Newton", "CPU s", "drape"], lines)
    reasons = [f"{row['id']}: {row['reason']}" for row in rows if not row["usable"]]
    return Report({"directory": str(farm.directory), "drapes": rows}, "\n".join([table, *reasons]), good)


def _values(text: str) -> tuple[str, Any]:
    """Key and grid of "solver.dt=0.02,0.01"; each value is read as a number where it is one."""
    key, equals, values = text.partition("=")
    parts, depth, quote = [""], 0, ""
    for letter in values:
        if letter in "\"'" and quote in ("", letter):
            quote = "" if quote else letter
        depth += 0 if quote else (letter in "[{") - (letter in "]}")
        if letter == "," and depth <= 0 and not quote:
            parts.append("")
        else:
            parts[-1] += letter
    given = [part.strip() for part in parts if part.strip()]
    if re.fullmatch(r"\s*[-+.\de]+:[-+.\de:]+\s*", values):
        raise InputError(f"--vary {text!r} is a range.", f"List the values: --vary {key.strip()}=0.01,0.02,0.03.")
    if not equals or not given:
        raise InputError(f"--vary {text!r} names no values.", "Write --vary solver.dt=0.02,0.01.")
    return key.strip(), {"grid": [_value(part) for part in given]}


def _value(text: str) -> Any:
    """A value of --vary: as of --set, and ".02" is a number."""
    with contextlib.suppress(ValueError):
        return int(text)
    with contextlib.suppress(ValueError):
        return float(text)
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except (ValueError, RecursionError):
        return text
