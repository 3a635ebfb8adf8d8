"""`clothsim keys`: the keys of a scene file."""

import argparse
from typing import Any

from clothsim import engine
from clothsim.base.errors import InputError
from clothsim.base.text import text_table
from clothsim.cli.report import Report

_DESCRIPTION = """\
List the sections of a scene file, or the keys of one with type, default, unit, range and meaning.

  clothsim keys solver
  clothsim keys effects.gravity
"""


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    keys = commands.add_parser("keys", description=_DESCRIPTION)
    keys.add_argument(
        "section", nargs="?", metavar="SECTION", help="solver, cloth, gravity, rectangle, ... (default: all)"
    )
    keys.add_argument("--json-schema", action="store_true", help="print the JSON schema, for editors")
    keys.add_argument("--markdown", action="store_true", help="print the reference page")
    keys.add_argument("--json", action="store_true", help="as JSON: {section: {summary, keys}}")
    keys.add_argument("--debug", action="store_true", help="show tracebacks")
    keys.set_defaults(handler=_keys)


def _keys(arguments: argparse.Namespace) -> Report | int:
    if arguments.section and (arguments.json_schema or arguments.markdown):
        raise InputError("--json-schema and --markdown are of all sections.", "Leave the section out.")
    if arguments.json_schema:
        print(engine.reference_text("json"))
        return 0
    if arguments.markdown:
        print(engine.reference_text("markdown"), end="")
        return 0
    text = overview() if arguments.section is None else keys_of_section(arguments.section)
    return Report(engine.reference(arguments.section), text)


def overview() -> str:
    """The sections, a line each."""
    rows = [(name, str(len(section["keys"])), section["summary"]) for name, section in engine.reference().items()]
    return text_table(("section", "keys", "summary"), rows)


def keys_of_section(name: str) -> str:
    """The keys of a section, or of all whose name holds `name` as a word; "solver.dt" is one key."""
    parts = []
    for section, content in engine.reference(name).items():
        head = f"[{section}]" if "=" not in section else section
        rows = [(key, *columns.values()) for key, columns in content["keys"].items()]
        columns = ["key", *next(iter(content["keys"].values()), {})]
        parts.append(f"{head}: {content['summary']}\n" + (text_table(columns, rows) if rows else "It takes no keys."))
    return "\n\n".join(parts)
