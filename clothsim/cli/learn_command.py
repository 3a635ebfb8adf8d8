"""`clothsim learn`: a model of the drapes of a farm."""

import argparse
from pathlib import Path
from typing import Any

from clothsim.cli import on_demand
from clothsim.cli.report import Report

_DESCRIPTION = """\
Learn the drapes of a farm as a function of its varied numbers, for [seed] from = "model".

  clothsim learn drapes -o model.npz

The error is that of drapes that were held out, beside the error of the mean drape.
"""


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    learn = commands.add_parser("learn", description=_DESCRIPTION)
    learn.add_argument("directory", type=Path, metavar="DIR", help="folder of the farm")
    learn.add_argument("-o", "--output", type=Path, metavar="FILE", required=True, help="the model, an .npz file")
    learn.add_argument("--held-out", type=float, default=0.25, metavar="F", help="fraction held out (default .25)")
    learn.add_argument("--components", type=int, default=16, metavar="K", help="principal components (default 16)")
    learn.add_argument("--quiet", action="store_true", help="print nothing but errors")
    learn.add_argument("--json", action="store_true", help="print the errors as JSON")
    learn.add_argument("--debug", action="store_true", help="show tracebacks")
    learn.set_defaults(handler=_learn)


def _learn(arguments: argparse.Namespace) -> Report:
    made = on_demand.learn(on_demand.open_farm(arguments.directory), arguments.held_out, arguments.components)
    made.model.write(arguments.output)
    names = ("training", "held_out", "left_out", "error", "mean_error", "nearest_error")
    return Report(
        {"model": str(arguments.output), **{name: getattr(made, name) for name in names}},
        f"{arguments.output}: {made.training} drapes learned, {made.held_out} held out, {made.left_out} left out "
        f"(another mesh).\nerror of held-out drapes (rms): model {1e3 * made.error:.2f} mm, nearest drape "
        f"{1e3 * made.nearest_error:.2f} mm, mean drape {1e3 * made.mean_error:.2f} mm.",
    )
