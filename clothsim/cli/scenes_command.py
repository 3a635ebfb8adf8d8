"""`clothsim scenes`: the example scenes."""

import argparse
from typing import Any

from clothsim import engine
from clothsim.cli.report import Report

_DESCRIPTION = """\
List the example scenes. `clothsim run NAME` simulates one where no file has that name.

  clothsim scenes --json
  clothsim run sphere
"""


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    scenes = commands.add_parser("scenes", description=_DESCRIPTION)
    scenes.add_argument("--json", action="store_true", help="as JSON: {name: {file, headline, missing}}")
    scenes.add_argument("--debug", action="store_true", help="show tracebacks")
    scenes.set_defaults(handler=_scenes)


def _scenes(arguments: argparse.Namespace) -> Report:
    scenes = engine.example_scenes()
    fields, lines = ("file", "headline", "missing"), []
    width = max(len(each.name) for each in scenes)
    for each in scenes:
        needs = f" (needs {', '.join(name.rsplit('/', 1)[-1] for name in each.missing)})" if each.missing else ""
        lines.append(f"{each.name:<{width}}  {each.headline}{needs}")
    document = {each.name: {key: getattr(each, key) for key in fields} for each in scenes}
    return Report(document, "\n".join([*lines, f"\n{scenes[0].file.parent}"]))
