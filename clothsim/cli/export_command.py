"""`clothsim export`, `render` and `bundle`: what is made of a run for other programs, for people, and to replay it."""

import argparse
import re
import shlex
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import clothsim
from clothsim import engine
from clothsim.base.errors import InputError
from clothsim.cli import on_demand
from clothsim.cli.arguments import (
    add_output_options,
    add_overwrite,
    as_direction,
    as_frame,
    as_limits,
    as_positive_number,
    as_printed_size,
    refuse_output,
)
from clothsim.cli.progress import frame_counter
from clothsim.cli.report import Report, program

if TYPE_CHECKING:
    from clothsim import Run

VIEW = "Give front, back, left, right or top, or three numbers, such as 1,-2,0.5."
_EXPORT = """\
Write the frames of a run for other programs: .obj, .ply (a file per frame), .pc2, .mdd (point caches with the mesh as
OBJ), .glb (morph targets), .usd, .usda, .usdc (pip install 'clothsim[usd]'), .vtkhdf.

  clothsim export drape -o drape.glb
  clothsim export drape -o drape.usdc --fps 24 --scale 100 --up y
  clothsim export drape -o last.obj --frame last
"""
_RENDER = """\
Draw one frame of a run (.png) or all of them (.mp4, .webp, .gif).

  clothsim render drape -o side.png --frame 10 --view 1,-2,0.5 --field stress
  clothsim render drape -o figure.png --style print --range 0.95,1.05 --size 85x64mm
"""
_BUNDLE = """\
Pack a run into one archive: scene, meshes, last good state, record. `clothsim resume FILE.zip` replays its failure.

  clothsim bundle drape -o drape.zip
"""


def add_to(commands: Any) -> None:
    """Add the commands to the parser."""
    export = commands.add_parser("export", description=_EXPORT)
    export.add_argument("directory", type=Path, metavar="DIR", help="the output of `clothsim run`")
    export.add_argument(
        "-o", "--output", type=Path, metavar="FILE", required=True, help="the file; its ending selects the format"
    )
    export.add_argument("--frame", metavar="N", help="one frame: 0, 1, ... or last (default: all)")
    export.add_argument("--fps", metavar="N", help="frames per second, interpolated (default: the run's)")
    export.add_argument("--scale", default="1", metavar="N", help="units of the file per metre: 100 for cm")
    export.add_argument("--up", choices=("y", "z"), help="the up axis (default: the format's or the scene's)")
    export.add_argument(
        "--colour", choices=("stretch", "plain"), default="stretch", help="colour of the cloth's vertices"
    )
    add_overwrite(export)
    add_output_options(
        export, json="print files, frames, rate, unit and axis as JSON", quiet="print nothing", handler=_export
    )
    render = commands.add_parser("render", description=_RENDER, usage="%(prog)s DIR [options]")
    render.add_argument("directory", type=Path, metavar="DIR", help="the output of `clothsim run`")
    render.add_argument(
        "-o", "--output", type=Path, metavar="FILE", help=".png, .mp4, .webp or .gif (default DIR/picture.png)"
    )
    render.add_argument("--frame", metavar="N", help="frame of a picture: 0, 1, ... or last (default)")
    render.add_argument("--size", metavar="WxH", help="pixels, or 85x64mm at 300 dots per inch")
    render.add_argument("--view", default="auto", metavar="X,Y,Z", help="or front, back, left, right, top")
    render.add_argument("--up", metavar="X,Y,Z", help="the up direction (default: against gravity)")
    look = render.add_mutually_exclusive_group()
    look.add_argument("--colour", metavar="C", help="stretch, plain, navy or red/white")
    look.add_argument("--field", metavar="NAME", help="colour by a field: stress, compression, ...")
    render.add_argument(
        "--style", choices=("fields", "print", "fabric", "studio"), default="fields", metavar="S",
        help="fields (default), print (outlines on white), fabric (woven) or studio (path tracing, minutes)",
    )  # fmt: skip
    render.add_argument("--range", metavar="LOW,HIGH", help="range of the colours (default: percentiles)")
    render.add_argument("--follow", action="store_true", help="the camera of a movie follows the cloth")
    render.add_argument("--true-mesh", action="store_true", help="draw the triangles, not a smooth surface")
    render.add_argument("--frames-per-second", metavar="N", help="frame rate of a movie")
    add_overwrite(render)
    add_output_options(render, json="print the file as JSON", quiet="print nothing", handler=_render)
    bundle = commands.add_parser("bundle", description=_BUNDLE)
    bundle.add_argument("directory", type=Path, metavar="DIR", help="the output of `clothsim run`")
    bundle.add_argument("-o", "--output", type=Path, metavar="FILE", help="the archive (default: DIR.zip)")
    add_overwrite(bundle)
    add_output_options(bundle, json="print file and size as JSON", handler=_bundle)


def _export(arguments: argparse.Namespace) -> Report:
    done = clothsim.open_run(arguments.directory).export(
        arguments.output,
        frame=None if arguments.frame is None else as_frame(arguments.frame),
        fps=None if arguments.fps is None else as_positive_number("--fps", arguments.fps),
        scale=as_positive_number("--scale", arguments.scale, "Give units of the file per metre: 100 for cm."),
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


def _render(arguments: argparse.Namespace) -> Report:
    run = clothsim.open_run(arguments.directory)
    target = arguments.output or run.directory / "picture.png"
    settings: dict[str, Any] = {
        "colour": arguments.colour or "auto",
        "style": arguments.style,
        "smooth": not arguments.true_mesh,
        "view": arguments.view if arguments.view.isalpha() else as_direction("--view", arguments.view, VIEW),
        "up": run.up if arguments.up is None else as_direction("--up", arguments.up),
        "field": arguments.field,
    }
    if arguments.range is not None:
        settings["limits"] = as_limits("--range", arguments.range)
    dots_per_inch = 0.0
    if arguments.size is not None:
        settings["size"], dots_per_inch = as_printed_size(arguments.size)
    if not (
        target.name in on_demand.RUN_PICTURES and target.parent.resolve() == run.directory.resolve()
    ):  # the run's own
        refuse_output(target, arguments)
    note = _drawn(run, target, arguments, settings, dots_per_inch)
    return Report({"file": str(target), "note": note}, f"{target}: {note}")


def _drawn(
    run: "Run", target: Path, arguments: argparse.Namespace, settings: dict[str, Any], dots_per_inch: float
) -> str:
    """Draw the picture or the movie that the ending asks for; return the line that names the renderer."""
    ending, of_movies = target.suffix.lower(), arguments.frames_per_second is not None or arguments.follow
    if ending == ".png" and of_movies:
        option = "--follow" if arguments.follow else "--frames-per-second"
        raise InputError(f"{option} is for movies.", "Leave it out, or name an .mp4 or .webp with -o.")
    if ending == ".png":
        frame = _frame(run, arguments.frame or "last")
        return engine.draw_run(run, target, frame, dots_per_inch=dots_per_inch, **settings)
    if ending not in (".mp4", ".webp", ".gif"):
        raise InputError(f"{target.name} is neither a picture nor a movie.", "End it in .png, .mp4, .webp or .gif.")
    if arguments.frame is not None:
        raise InputError("--frame is for pictures.", "Leave it out, or name a .png with -o.")
    if arguments.frames_per_second is not None:
        settings["frames_per_second"] = as_positive_number("--frames-per-second", arguments.frames_per_second)
    counter = frame_counter(arguments.quiet)
    return engine.draw_run(run, target, progress=counter, follow=arguments.follow, **settings)


def _frame(run: "Run", text: str) -> int:
    if text == "last":
        return len(run.times) - 1
    if not re.fullmatch(r"-?\d{1,9}", text):
        raise InputError(f"--frame is {text!r}.", f"Give 0 to {len(run.times) - 1}, or last.")
    if not -len(run.times) <= int(text) < len(run.times):
        raise InputError(f"There is no frame {text}.", f"The run has frames 0 to {len(run.times) - 1}.")
    return int(text)


def _bundle(arguments: argparse.Namespace) -> Report:
    directory = arguments.directory
    if not directory.is_dir():
        raise InputError(f"There is no run directory {directory}.")
    target = arguments.output or Path(f"{directory.resolve().name}.zip")
    if target.suffix != ".zip":
        raise InputError(f"{target.name} does not end in .zip.", "Give the archive that ending.")
    refuse_output(target, arguments)
    target.unlink(missing_ok=True)
    engine.write_bundle(directory, target)
    size = target.stat().st_size
    replay = f"{program()} resume {shlex.quote(str(target))}"
    return Report({"file": str(target), "bytes": size}, f"{target}: {size / 1e6:.2g} MB. Replay it with: {replay}")
