"""`clothsim view` and `preview`: the page of a run, and that of a model of drapes, in a browser."""

import argparse
import sys
import time
import webbrowser
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import clothsim
from clothsim import files
from clothsim.base.errors import ClothsimError, InputError
from clothsim.cli import on_demand
from clothsim.cli.arguments import add_output_options, as_count
from clothsim.cli.report import DONE, Report, end_watch

if TYPE_CHECKING:
    from clothsim.viewer.served import Served

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


def add_to(commands: Any) -> None:
    """Add the commands to the parser."""
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
