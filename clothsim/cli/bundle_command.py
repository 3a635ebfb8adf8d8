"""`clothsim bundle`: one archive that replays a run."""

import argparse
import shlex
from pathlib import Path
from typing import Any

from clothsim import engine
from clothsim.base.errors import InputError
from clothsim.cli.report import Report
from clothsim.cli.run_report import program

_DESCRIPTION = """\
Pack a run into one archive: scene, meshes, last good state, record. `clothsim resume FILE.zip` replays its failure.

  clothsim bundle drape -o drape.zip
"""


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    bundle = commands.add_parser("bundle", description=_DESCRIPTION)
    bundle.add_argument("directory", type=Path, metavar="DIR", help="the output of `clothsim run`")
    bundle.add_argument("-o", "--output", type=Path, metavar="FILE", help="the archive (default: DIR.zip)")
    bundle.add_argument("--json", action="store_true", help="print file and size as JSON")
    bundle.add_argument("--debug", action="store_true", help="show tracebacks")
    bundle.set_defaults(handler=_bundle)


def _bundle(arguments: argparse.Namespace) -> Report:
    directory = arguments.directory
    if not directory.is_dir():
        raise InputError(f"There is no run directory {directory}.")
    target = arguments.output or Path(f"{directory.resolve().name}.zip")
    if target.suffix != ".zip":
        raise InputError(f"{target.name} does not end in .zip.", "Give the archive that ending.")
    if not target.parent.is_dir():
        raise InputError(f"There is no directory {target.parent}.", "Make it first, or choose another with -o.")
    engine.write_bundle(directory, target)
    size = target.stat().st_size
    replay = f"{program()} resume {shlex.quote(str(target))}"
    return Report({"file": str(target), "bytes": size}, f"{target}: {size / 1e6:.2g} MB. Replay it with: {replay}")
