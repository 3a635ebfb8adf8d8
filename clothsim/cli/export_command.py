"""`clothsim export`, `render`, `bundle`, `view` and `preview`: a run as files, pictures, an archive or a page."""

import argparse
import re
import shlex
import sys
import time
import webbrowser
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import clothsim
from clothsim import engine, files
from clothsim.base.errors import ClothsimError, InputError
from clothsim.cli import on_demand
from clothsim.cli.arguments import (
    add_output_options,
    add_overwrite,
    as_count,
    as_direction,
    as_frame,
    as_limits,
    as_positive_number,
    as_printed_size,
    refuse_output,
)
from clothsim.cli.progress import frame_counter
from clothsim.cli.report import DONE, Report, end_watch, program

if TYPE_CHECKING:
    from clothsim.viewer.served import Served

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
    view = commands.add_parser("view", description=_VIEW)
    view.add_argument("directory", type=Path, metavar="DIR", help="the output of `clothsim run`")
    view.add_argument("--field", metavar="NAME", help="plain, stretch, stress, compression, ... (default: stretch)")
    _add_address(view)
    view.add_argument("--wait", action="store_true", help="wait for the first frame of a run that has just begun")
    view.add_argument("--browser", action="store_true", help="open the browser too")
    add_output_options(view, json="print the address as JSON", quiet="print nothing", handler=_view)
    shown = commands.add_parser("preview", description=_PREVIEW)
    shown.add_argument("directory", type=Path, metavar="DIR", help="the farm's folder, or its scene file")
    shown.add_argument("--motion", action="store_true", help="a garment in motion: the first argument is a scene")
    shown.add_argument("model", type=Path, metavar="MODEL", help="the output of `clothsim learn`")
    _add_address(shown)
    shown.add_argument("--browser", action="store_true", help="open the browser too")
    add_output_options(shown, json="print the address as JSON", quiet="print nothing", handler=_preview)


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
    ending, of_movies = target.suffix.lower(), arguments.frames_per_second is not None or arguments.follow
    if ending == ".png":
        if of_movies:
            option = "--follow" if arguments.follow else "--frames-per-second"
            raise InputError(f"{option} is for movies.", "Leave it out, or name an .mp4 or .webp with -o.")
        frame, last = arguments.frame or "last", len(run.times) - 1
        if frame != "last" and not re.fullmatch(r"-?\d{1,9}", frame):
            raise InputError(f"--frame is {frame!r}.", f"Give 0 to {last}, or last.")
        number = last if frame == "last" else int(frame)
        if not -len(run.times) <= number <= last:
            raise InputError(f"There is no frame {frame}.", f"The run has frames 0 to {last}.")
        note = engine.draw_run(run, target, number, dots_per_inch=dots_per_inch, **settings)
    else:
        if ending not in (".mp4", ".webp", ".gif"):
            raise InputError(f"{target.name} is neither a picture nor a movie.", "End it in .png, .mp4, .webp or .gif.")
        if arguments.frame is not None:
            raise InputError("--frame is for pictures.", "Leave it out, or name a .png with -o.")
        if arguments.frames_per_second is not None:
            settings["frames_per_second"] = as_positive_number("--frames-per-second", arguments.frames_per_second)
        counter = frame_counter(arguments.quiet)
        note = engine.draw_run(run, target, progress=counter, follow=arguments.follow, **settings)
    return Report({"file": str(target), "note": note}, f"{target}: {note}")


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


_VIEW = """\
Show a run in a browser, also one in progress: turn and scrub it, colour it by a field, pick a vertex. Needs
pip install 'clothsim[view]'. Ctrl-C ends it.

  clothsim view drape
  clothsim view drape --field stress --port 9000
"""
_PREVIEW = """\
Show a model of drapes in a browser: sliders for its inputs, the predicted garment with the result of the exact test,
and a button that drapes and certifies. Needs pip install 'clothsim[view]'. Ctrl-C ends it.

  clothsim preview drapes model.npz

With --motion, MODEL is from `clothsim learn --motion`, and the first argument is a scene with a moving body: the
figure moves, each frame with its verdict: certified as predicted, repaired, or simulated.

  clothsim preview walking.toml moving.npz --motion
"""


def _add_address(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--port", default="8080", metavar="N", help="port, or the next one that is free (default 8080)"
    )
    command.add_argument("--host", default="127.0.0.1", metavar="ADDRESS", help="0.0.0.0 opens it to the network")
    command.add_argument(
        "--trust",
        action="append",
        default=[],
        metavar="NAME:PORT",
        help="another name by which a browser reaches it, such as localhost:9000 for a tunnel",
    )


LONGEST_WAIT, PAUSE = 600.0, 0.3
"""Time to wait for a first frame, and between two looks [s]."""


def _view(arguments: argparse.Namespace) -> int:
    port = as_count("--port", arguments.port)
    if arguments.wait:
        _await_frame(arguments.directory)
    page = clothsim.view(arguments.directory, port, arguments.host, arguments.field, arguments.trust)
    return served(page, arguments, arguments.directory)


def served(page: "Served", arguments: argparse.Namespace, what: Path) -> int:
    """Tell the address of a page as --json, --quiet and --browser ask for it, and serve it until Ctrl-C."""
    Report({"url": page.url}, f"{page.url} shows {what}. Ctrl-C ends it.").show(arguments)
    if arguments.browser and not webbrowser.open(page.url):
        print(f"No browser was found: open {page.url}.", file=sys.stderr)
    end_watch()
    page.wait()
    return DONE


def _await_frame(directory: Path) -> None:
    """Return when a run that was begun after now has a frame. InputError after LONGEST_WAIT."""
    begun = time.time()
    for _ in range(int(LONGEST_WAIT / PAUSE)):
        file = directory / files.TRAJECTORY_NAME
        if file.is_file() and file.stat().st_mtime >= begun:
            with suppress(ClothsimError):
                if len(clothsim.open_run(directory)):
                    return
        time.sleep(PAUSE)
    raise InputError(f"{directory} had no frame after {LONGEST_WAIT:g} s.", "Start `clothsim view` when it has one.")


def _preview(arguments: argparse.Namespace) -> int:
    port, given = as_count("--port", arguments.port), arguments.directory
    is_scene = arguments.motion or given.suffix == ".toml"
    scene = clothsim.load_scene(given) if is_scene else on_demand.open_farm(given).scene
    show: Any = on_demand.preview_motion if arguments.motion else on_demand.preview
    page = show(scene, arguments.model, port, arguments.host, arguments.trust)
    return served(page, arguments, arguments.model)
