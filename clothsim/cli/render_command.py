"""`clothsim render`: a picture or a movie of a run."""

import argparse
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import clothsim
from clothsim import engine
from clothsim.base.errors import InputError
from clothsim.cli.arguments import as_direction, as_limits, as_positive_number, as_printed_size
from clothsim.cli.progress import frame_counter
from clothsim.cli.report import Report

if TYPE_CHECKING:
    from clothsim import Run

_DESCRIPTION = """\
Draw a frame of a run (.png) or all of them (.mp4, .gif).

  clothsim render drape -o side.png --frame 10 --view 1,-2,0.5 --field stress
  clothsim render drape -o figure.png --style print --range 0.95,1.05 --size 85x64mm
"""


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    render = commands.add_parser("render", description=_DESCRIPTION, usage="%(prog)s DIR [options]")
    render.add_argument("directory", type=Path, metavar="DIR", help="the output of `clothsim run`")
    render.add_argument(
        "-o", "--output", type=Path, metavar="FILE", help=".png, .mp4 or .gif (default DIR/picture.png)"
    )
    render.add_argument("--frame", metavar="N", help="of a picture: 0, 1, ... or last (default)")
    render.add_argument("--size", metavar="WxH", help="pixels, or 85x64mm at 300 dots per inch")
    render.add_argument("--view", default="auto", metavar="X,Y,Z", help="or front, back, left, right, top")
    render.add_argument("--up", metavar="X,Y,Z", help="default: against gravity")
    look = render.add_mutually_exclusive_group()
    look.add_argument(
        "--colour", choices=("stretch", "plain"), metavar="C", help="stretch or plain (default: the style's)"
    )
    look.add_argument("--field", metavar="NAME", help="colour by a field: stress, compression, ...")
    render.add_argument(
        "--style", choices=("fields", "print", "fabric"), default="fields", metavar="S",
        help="fields (default), print (outlines on white) or fabric (woven)",
    )  # fmt: skip
    render.add_argument("--range", metavar="LOW,HIGH", help="of the colours (default: percentiles)")
    render.add_argument("--follow", action="store_true", help="a movie's camera moves along")
    render.add_argument("--true-mesh", action="store_true", help="its triangles, not a smooth surface")
    render.add_argument("--frames-per-second", metavar="N", help="of a movie")
    render.add_argument("--quiet", action="store_true", help="print nothing")
    render.add_argument("--json", action="store_true", help="print the file as JSON")
    render.add_argument("--debug", action="store_true", help="show tracebacks")
    render.set_defaults(handler=_render)


def _render(arguments: argparse.Namespace) -> Report:
    run = clothsim.open_run(arguments.directory)
    target = arguments.output or run.directory / "picture.png"
    settings: dict[str, Any] = {
        "colour": arguments.colour or "auto",
        "style": arguments.style,
        "smooth": not arguments.true_mesh,
        "view": arguments.view if arguments.view.isalpha() else as_direction("--view", arguments.view),
        "up": run.up if arguments.up is None else as_direction("--up", arguments.up),
        "field": arguments.field,
    }
    if arguments.range is not None:
        settings["limits"] = as_limits("--range", arguments.range)
    dots_per_inch = 0.0
    if arguments.size is not None:
        settings["size"], dots_per_inch = as_printed_size(arguments.size)
    if not target.parent.is_dir():
        raise InputError(f"There is no directory {target.parent}.", "Make it first, or choose another with -o.")
    note = _drawn(run, target, arguments, settings, dots_per_inch)
    return Report({"file": str(target), "note": note}, f"{target}: {note}")


def _drawn(
    run: "Run", target: Path, arguments: argparse.Namespace, settings: dict[str, Any], dots_per_inch: float
) -> str:
    """Draw the picture or the movie that the ending asks for; return the line that names the renderer."""
    ending, of_movies = target.suffix.lower(), arguments.frames_per_second is not None or arguments.follow
    if ending == ".png" and of_movies:
        option = "--follow" if arguments.follow else "--frames-per-second"
        raise InputError(f"{option} is for movies.", "Leave it out, or name an .mp4 or .gif with -o.")
    if ending == ".png":
        frame = _frame(run, arguments.frame or "last")
        return engine.draw_run(run, target, frame, dots_per_inch=dots_per_inch, **settings)
    if ending not in (".mp4", ".gif"):
        raise InputError(f"{target.name} is neither a picture nor a movie.", "End it in .png, .mp4 or .gif.")
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
