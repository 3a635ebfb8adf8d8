"""`clothsim export`: the frames of a run for other programs."""

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import Any

import clothsim
from clothsim.cli.arguments import as_frame, as_positive_number
from clothsim.cli.report import Report

_DESCRIPTION = """\
Write the frames of a run for other programs: .obj, .ply (a file a frame), .pc2, .mdd (point caches with the mesh as
OBJ), .glb (morph targets), .usd, .usda, .usdc (pip install 'clothsim[usd]'), .vtkhdf.

  clothsim export drape -o drape.glb
  clothsim export drape -o drape.usdc --fps 24 --scale 100 --up y
  clothsim export drape -o last.obj --frame last
"""


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    export = commands.add_parser("export", description=_DESCRIPTION)
    export.add_argument("directory", type=Path, metavar="DIR", help="the output of `clothsim run`")
    export.add_argument("-o", "--output", type=Path, metavar="FILE", required=True, help="its ending is the format")
    export.add_argument("--frame", metavar="N", help="one frame: 0, 1, ... or last (default: all)")
    export.add_argument("--fps", metavar="N", help="frames a second, linear between the run's (default: its own)")
    export.add_argument("--scale", default="1", metavar="N", help="units of the file in a metre: 100 for cm")
    export.add_argument("--up", choices=("y", "z"), help="axis against gravity (default: the format's or the scene's)")
    export.add_argument("--colour", choices=("stretch", "plain"), default="stretch", help="of the cloth's vertices")
    export.add_argument("--overwrite", action="store_true", help="replace files that exist")
    export.add_argument("--quiet", action="store_true", help="print nothing")
    export.add_argument("--json", action="store_true", help="print files, frames, rate, unit and axis as JSON")
    export.add_argument("--debug", action="store_true", help="show tracebacks")
    export.set_defaults(handler=_export)


def _export(arguments: argparse.Namespace) -> Report:
    done = clothsim.open_run(arguments.directory).export(
        arguments.output,
        frame=None if arguments.frame is None else as_frame(arguments.frame),
        fps=None if arguments.fps is None else as_positive_number("--fps", arguments.fps),
        scale=as_positive_number("--scale", arguments.scale),
        up=arguments.up,
        colour=arguments.colour,
        overwrite=arguments.overwrite,
    )
    size = sum(file.stat().st_size for file in done.files)
    written = f"{done.files[0]}" + (f" and {len(done.files) - 1} more" if len(done.files) > 1 else "")
    between = f" ({done.interpolated} interpolated)" if done.interpolated else ""
    frames = "1 frame" if done.frames == 1 else f"{done.frames} frames{between} at {done.rate:g} a second"
    line = f"{written}: {frames}, 1 unit = {done.unit:g} m, {done.up} up, {size / 1e6:.2g} MB"
    document = {**asdict(done), "files": [str(file) for file in done.files]}
    return Report(document, "\n".join([line, *done.notes]))
