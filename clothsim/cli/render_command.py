"""`clothsim render`: a picture or a movie of a run."""

import argparse
import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from clothsim.cli.arguments import as_direction, as_positive_number, as_size
from clothsim.errors import InputError

if TYPE_CHECKING:
    from clothsim.io.results import Run
    from clothsim.mesh.world import World

_DESCRIPTION = """\
Draw a frame of a run (.png) or all of them (.mp4, .gif).

  clothsim render drape -o side.png --frame 10 --view 1,-2,0.5
"""


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    render = commands.add_parser("render", help="draw a picture or a movie of a run", description=_DESCRIPTION)
    render.add_argument("directory", type=Path, metavar="DIR", help="what `clothsim run` left")
    render.add_argument(
        "-o", "--output", type=Path, metavar="FILE", help=".png, .mp4 or .gif (default DIR/picture.png)"
    )
    render.add_argument("--frame", metavar="N", help="of a picture: 0, 1, ... or last (default)")
    render.add_argument("--size", metavar="WxH", help="pixels (default 1280x960, of a movie 960x720)")
    render.add_argument("--view", default="auto", metavar="X,Y,Z", help="direction from the scene to the camera")
    render.add_argument("--up", metavar="X,Y,Z", help="x, y, z or a direction (default: against gravity)")
    render.add_argument("--colour", choices=("stretch", "plain"), default="stretch", help="of the cloth")
    render.add_argument("--frames-per-second", metavar="N", help="of a movie (default: as fast as it was)")
    render.add_argument("--quiet", action="store_true", help="print nothing")
    render.add_argument("--debug", action="store_true", help="show tracebacks")
    render.set_defaults(handler=_render)


def _render(arguments: argparse.Namespace) -> int:
    from clothsim.io.results import open_run

    run = open_run(arguments.directory)
    target = arguments.output or run.directory / "picture.png"
    ending = target.suffix.lower()
    settings: dict[str, Any] = {
        "colour": arguments.colour,
        "view": as_direction("--view", arguments.view),
        "up": upright(run) if arguments.up is None else as_direction("--up", arguments.up),
    }
    if arguments.size is not None:
        settings["size"] = as_size(arguments.size)
    if not target.parent.is_dir():
        raise InputError(f"There is no directory {target.parent}.", "Make it first, or choose another with -o.")
    if ending == ".png":
        if arguments.frames_per_second is not None:
            raise InputError("--frames-per-second is for movies.", "Leave it out, or name an .mp4 or .gif with -o.")
        note = draw_frame(run, target, frame=_frame(run, arguments.frame or "last"), **settings)
    elif ending in (".mp4", ".gif"):
        if arguments.frame is not None:
            raise InputError("--frame is for pictures.", "Leave it out, or name a .png with -o.")
        if arguments.frames_per_second is not None:
            settings["frames_per_second"] = as_positive_number("--frames-per-second", arguments.frames_per_second)
        note = draw_movie(run, target, quiet=arguments.quiet, **settings)
    else:
        raise InputError(f"{target.name} is neither a picture nor a movie.", "End it in .png, .mp4 or .gif.")
    if not arguments.quiet:
        print(f"{target}: {note}")
    return 0


def draw_frame(run: "Run", target: Path, frame: int = -1, **settings: Any) -> str:
    """A PNG of one frame; returns the line that says what drew it."""
    from clothsim.render.picture import draw
    from clothsim.render.run_frames import frame_surfaces

    title = f"{run.times[frame]:.2f} s" if len(run.times) else ""
    return draw(target, frame_surfaces(run, frame), title=title, **settings)


def draw_failure(run: "Run", world: "World", target: Path, up: Any) -> str:
    """A PNG of the place where a run failed, in its last good state; returns the line that says what drew it."""
    import numpy as np

    from clothsim.io.checkpoint import CHECKPOINT_NAME, read_checkpoint
    from clothsim.render.closeup import draw_place
    from clothsim.render.run_frames import state_surfaces
    from clothsim.sim.certificate import world_stretches

    failure = run.summary["failure"]
    x = read_checkpoint(run.directory / CHECKPOINT_NAME).positions
    surfaces = state_surfaces(world, x, world_stretches(world, x))
    title = f"{failure['time']:.4g} s, {failure['cause']}: {failure['element']}"
    return draw_place(target, surfaces, np.array(failure["position"]) - world.origin, title=title, up=up)


def draw_movie(run: "Run", target: Path, quiet: bool, **settings: Any) -> str:
    """A movie of all frames, in real time unless told otherwise; returns the line that says what drew it."""
    from clothsim.render.movie import movie
    from clothsim.render.run_frames import Frames

    if "frames_per_second" not in settings and len(run.times) > 1:
        settings["frames_per_second"] = (len(run.times) - 1) / (run.times[-1] - run.times[0])

    def progress(done: int, total: int) -> None:
        if not quiet and sys.stderr.isatty():
            print(f"\rframe {done} of {total}", end="" if done < total else "\n", file=sys.stderr, flush=True)

    return movie(target, Frames(run), progress=progress, **settings)


def upright(run: "Run") -> tuple[float, ...] | str:
    """Against the scene's gravity, where the run's checkpoint tells of it; else "z"."""
    from clothsim.io.checkpoint import CHECKPOINT_NAME, read_checkpoint
    from clothsim.scene.scene import scene_from_text

    try:
        scene = scene_from_text(read_checkpoint(run.directory / CHECKPOINT_NAME).scene_text)
    except InputError:  # none, or of another version: a picture can do without
        return "z"
    acceleration = scene.effects.get("gravity", {}).get("acceleration", (0.0, 0.0, -1.0))
    return tuple(-float(a) for a in acceleration) if any(acceleration) else "z"


def _frame(run: "Run", text: str) -> int:
    if text == "last":
        return len(run.times) - 1
    if not re.fullmatch(r"-?\d{1,9}", text):
        raise InputError(f"--frame is {text!r}.", f"Give 0 to {len(run.times) - 1}, or last.")
    if not -len(run.times) <= int(text) < len(run.times):
        raise InputError(f"There is no frame {text}.", f"The run has frames 0 to {len(run.times) - 1}.")
    return int(text)
