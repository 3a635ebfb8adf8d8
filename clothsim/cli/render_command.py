"""`clothsim render`: a picture or a movie of a run."""

import argparse
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from clothsim.cli.arguments import as_direction, as_positive_number, as_size
from clothsim.errors import InputError

if TYPE_CHECKING:
    from clothsim.run.results import Run

_DESCRIPTION = """\
Draw a frame of a run (.png) or all of them (.mp4, .gif).

  clothsim render drape -o side.png --frame 10 --view 1,-2,0.5
  clothsim render drape -o stress.png --field stress
"""


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    render = commands.add_parser("render", help="draw a picture or a movie of a run", description=_DESCRIPTION)
    render.add_argument("directory", type=Path, metavar="DIR", help="the output of `clothsim run`")
    render.add_argument(
        "-o", "--output", type=Path, metavar="FILE", help=".png, .mp4 or .gif (default DIR/picture.png)"
    )
    render.add_argument("--frame", metavar="N", help="of a picture: 0, 1, ... or last (default)")
    render.add_argument("--size", metavar="WxH", help="pixels (default 1280x960, of a movie 960x720)")
    render.add_argument(
        "--view", default="auto", metavar="X,Y,Z", help="of the camera; or front, back, left, right, top"
    )
    render.add_argument("--up", metavar="X,Y,Z", help="x, y, z or a direction (default: against gravity)")
    look = render.add_mutually_exclusive_group()
    look.add_argument("--colour", choices=("stretch", "plain"), default="stretch", help="of the cloth")
    look.add_argument("--field", metavar="NAME", help="colour by a field: stress, compression, ...")
    render.add_argument("--true-mesh", action="store_true", help="the triangles, not a smooth surface through them")
    render.add_argument("--frames-per-second", metavar="N", help="of a movie (default: as fast as it was)")
    render.add_argument("--quiet", action="store_true", help="print nothing")
    render.add_argument("--json", action="store_true", help="print the file as JSON")
    render.add_argument("--debug", action="store_true", help="show tracebacks")
    render.set_defaults(handler=_render)


def _render(arguments: argparse.Namespace) -> int:
    from clothsim.render.camera import VIEWS
    from clothsim.run.field_pictures import field_settings
    from clothsim.run.pictures import draw_frame, draw_movie, upright
    from clothsim.run.results import open_run

    run = open_run(arguments.directory)
    target = arguments.output or run.directory / "picture.png"
    ending = target.suffix.lower()
    settings: dict[str, Any] = {
        "colour": arguments.colour,
        "smooth": not arguments.true_mesh,
        "view": as_direction("--view", arguments.view, VIEWS),
        "up": upright(run.directory) if arguments.up is None else as_direction("--up", arguments.up),
    }
    if arguments.field is not None:
        settings |= field_settings(run, arguments.field)
    if arguments.size is not None:
        settings["size"] = as_size(arguments.size)
    if not target.parent.is_dir():
        raise InputError(f"There is no directory {target.parent}.", "Make it first, or choose another with -o.")
    if ending == ".png":
        if arguments.frames_per_second is not None:
            raise InputError("--frames-per-second is for movies.", "Leave it out, or name an .mp4 or .gif with -o.")
        note = draw_frame(run.trajectory, target, frame=_frame(run, arguments.frame or "last"), **settings)
    elif ending in (".mp4", ".gif"):
        if arguments.frame is not None:
            raise InputError("--frame is for pictures.", "Leave it out, or name a .png with -o.")
        if arguments.frames_per_second is not None:
            settings["frames_per_second"] = as_positive_number("--frames-per-second", arguments.frames_per_second)
        note = draw_movie(run.trajectory, target, progress=frame_counter(arguments.quiet), **settings)
    else:
        raise InputError(f"{target.name} is neither a picture nor a movie.", "End it in .png, .mp4 or .gif.")
    if arguments.json:
        from clothsim.io.record import to_json

        print(to_json({"file": str(target), "note": note}))
    elif not arguments.quiet:
        print(f"{target}: {note}")
    return 0


def frame_counter(quiet: bool) -> Callable[[int, int], None]:
    """A callback that prints the number of the frame that is drawn; nothing where `quiet` or without a terminal."""

    def progress(done: int, total: int) -> None:
        if not quiet and sys.stderr.isatty():
            print(f"\rframe {done} of {total}", end="" if done < total else "\n", file=sys.stderr, flush=True)

    return progress


def _frame(run: "Run", text: str) -> int:
    if text == "last":
        return len(run.times) - 1
    if not re.fullmatch(r"-?\d{1,9}", text):
        raise InputError(f"--frame is {text!r}.", f"Give 0 to {len(run.times) - 1}, or last.")
    if not -len(run.times) <= int(text) < len(run.times):
        raise InputError(f"There is no frame {text}.", f"The run has frames 0 to {len(run.times) - 1}.")
    return int(text)
