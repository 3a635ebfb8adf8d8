"""`clothsim wrinkle`: a finer cloth that follows a coarse run, with the wrinkles that the coarse mesh lacks."""

import argparse
import re
from pathlib import Path
from typing import Any

import clothsim
from clothsim import engine
from clothsim.base.errors import InputError
from clothsim.cli import on_demand
from clothsim.cli.arguments import add_output_options, add_overwrite, as_length
from clothsim.cli.report import messages
from clothsim.cli.run_command import execute

_WRINKLE = """\
Give the cloth of a coarse run wrinkles: waves where it is compressed, as targets of a finer cloth under contact.
Leaves the files of a run, whose frames are checked exactly, targets.npy and wrinkles.json.

  clothsim run twist -o coarse --set effects.membrane.compression=0.05
  clothsim wrinkle coarse --cells 4x -o fine
"""


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    wrinkle = commands.add_parser("wrinkle", description=_WRINKLE)
    wrinkle.add_argument("directory", type=Path, metavar="RUN", help="the output of `clothsim run`")
    wrinkle.add_argument("-o", "--output", type=Path, metavar="DIR", required=True, help="output directory")
    wrinkle.add_argument("--cells", default="4x", metavar="Nx", help="parts of each edge, 2x to 8x (default: 4x)")
    wrinkle.add_argument("--least-radius", metavar="LENGTH", help="of crests by fabric: 4mm (default: by mechanics)")
    add_overwrite(wrinkle, "replace an earlier run in the output directory")
    wrinkle.add_argument("--no-picture", action="store_true", help="leave no picture.png and no failure.png")
    wrinkle.add_argument("--movie", action="store_true", help="leave movie.mp4 too, movie.gif without ffmpeg")
    wrinkle.set_defaults(dump_iterates=None)
    add_output_options(
        wrinkle, json="print the summary as JSON, the rest on stderr", quiet="print the end only", handler=_wrinkle
    )


def _wrinkle(arguments: argparse.Namespace) -> int:
    parts = _parts(arguments.cells)
    radius = None if arguments.least_radius is None else as_length("--least-radius", arguments.least_radius)
    run = clothsim.open_run(arguments.directory)
    on_demand.refuse_unfit(run, parts)
    names = (*on_demand.RUN_PICTURES, *on_demand.OWN_FILES)
    engine.refuse_earlier_run(arguments.output, arguments.overwrite, names, (run.directory,))
    message = messages(arguments)

    def job(progress: Any, announce: Any, dump_iterates: None) -> "clothsim.Run":
        return on_demand.wrinkle(
            run,
            parts,
            arguments.output,
            radius,
            message=message,
            overwrite=arguments.overwrite,
            progress=progress,
            announce=announce,
        )

    return execute(arguments, arguments.output, job)


def _parts(text: str) -> int:
    """The number of "4x"."""
    match = re.fullmatch(r"(\d{1,9})x", text.strip())
    if not match:
        raise InputError(f"--cells is {text!r}.", "Give the parts of each edge, such as 4x.")
    return int(match[1])
