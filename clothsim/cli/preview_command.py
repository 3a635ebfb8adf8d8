"""`clothsim preview`: the predictions of a model of drapes in a browser."""

import argparse
from pathlib import Path
from typing import Any

import clothsim
from clothsim.cli import on_demand
from clothsim.cli.arguments import as_count
from clothsim.cli.view_command import served

_DESCRIPTION = """\
Move the inputs of a model of drapes in a browser: the predicted garment with the verdict of the exact test, and a
button that drapes and certifies. Needs pip install 'clothsim[view]'. Ctrl-C ends it.

  clothsim preview drapes model.npz
"""


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    shown = commands.add_parser("preview", description=_DESCRIPTION)
    shown.add_argument("directory", type=Path, metavar="DIR", help="folder of the farm, or a scene file of the same")
    shown.add_argument("model", type=Path, metavar="MODEL", help="the output of `clothsim learn`")
    shown.add_argument("--port", default="8080", metavar="N", help="port, or the next one that is free (default 8080)")
    shown.add_argument("--host", default="127.0.0.1", metavar="ADDRESS", help="0.0.0.0 opens it to the network")
    shown.add_argument("--browser", action="store_true", help="open the browser too")
    shown.add_argument("--quiet", action="store_true", help="print nothing")
    shown.add_argument("--json", action="store_true", help="print the address as JSON")
    shown.add_argument("--debug", action="store_true", help="show tracebacks")
    shown.set_defaults(handler=_preview)


def _preview(arguments: argparse.Namespace) -> int:
    port, given = as_count("--port", arguments.port), arguments.directory
    scene = clothsim.load_scene(given) if given.suffix == ".toml" else on_demand.open_farm(given).scene
    page = on_demand.preview(scene, arguments.model, port=port, host=arguments.host)
    return served(page, arguments, arguments.model)
