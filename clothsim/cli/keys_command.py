"""`clothsim keys`: the keys of a scene file."""

import argparse
import json
from difflib import get_close_matches
from typing import Any

from clothsim import engine
from clothsim.base.errors import InputError
from clothsim.base.text_table import text_table

_DESCRIPTION = """\
List the sections of a scene file, or the keys of one with type, default, unit, range and meaning.

  clothsim keys solver
  clothsim keys effects.gravity
"""

SIMILAR = 0.75
"""Similarity, from 0 to 1, from which on a name is taken for another one misspelt."""


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


def _keys(arguments: argparse.Namespace) -> int:
    if arguments.section and (arguments.json_schema or arguments.markdown):
        raise InputError("--json-schema and --markdown are of all sections.", "Leave the section out.")
    if arguments.json_schema:
        print(json.dumps(engine.json_schema(), indent=2))
    elif arguments.json:
        print(json.dumps(document(arguments.section)))
    elif arguments.markdown:
        print(engine.markdown(), end="")
    else:
        print(overview() if arguments.section is None else keys_of_section(arguments.section))
    return 0


def overview() -> str:
    """The sections, a line each."""
    rows = [(name, str(len(section.keys)), section.summary) for name, section in engine.sections().items()]
    return text_table(("section", "keys", "summary"), rows)


def keys_of_section(name: str) -> str:
    """The keys of a section, or of all whose name holds `name` as a word; "solver.dt" is one key.

    Raises
    ------
    InputError
        For a name that is no section, with the nearest known one.
    """
    matching, only = _matching(name)
    parts = []
    for section in matching:
        rows = [engine.row(key) for key in section.keys.values() if only in (None, key.name)]
        head = f"[{section.name}]" if "=" not in section.name else section.name
        parts.append(
            f"{head}: {section.summary}\n" + (text_table(engine.COLUMNS, rows) if rows else "It takes no keys.")
        )
    return "\n\n".join(parts)


def document(name: str | None) -> dict[str, Any]:
    """The sections that a name matches, or all: summary, and the columns of `clothsim keys` of each key."""
    matching, only = (list(engine.sections().values()), None) if name is None else _matching(name)
    return {
        section.name: {
            "summary": section.summary,
            "keys": {
                key.name: dict(zip(engine.COLUMNS[1:], engine.row(key)[1:], strict=True))
                for key in section.keys.values()
                if only in (None, key.name)
            },
        }
        for section in matching
    }


def _matching(name: str) -> tuple[list[Any], str | None]:
    """The sections of a name, and the name of the only key that is meant. InputError for an unknown one."""
    known = engine.sections()
    words = _words(name)
    matching = [
        section for section in known.values() if section.name == name or (words and words <= _words(section.name))
    ]
    only = None
    if not matching:
        parent, _, only = name.rpartition(".")
        matching = [section for section in known.values() if section.name in (parent, f"effects.{parent}")]
        matching = [section for section in matching if only in section.keys]
    if not matching:
        raise InputError(f"There is no section or key {name!r}.", _near(name))
    return matching, only


def _near(name: str) -> str:
    """Remedy for an unknown name: the nearest section or key, or the sections of a key of this name."""
    known = engine.sections()
    words = {word for section in known for word in _words(section)}
    keys = {f"{section.name}.{key}" for section in known.values() for key in section.keys}
    last = name.rpartition(".")[2]
    of_name = engine.nearest(name, [*known, *sorted(keys)], SIMILAR) if "." in name else ""
    of_word = engine.nearest(last, sorted(words), SIMILAR)
    close = get_close_matches(last, {key.rpartition(".")[2] for key in keys}, n=1, cutoff=SIMILAR)
    of_key = engine.home_of(close[0]) if close else ""
    return of_name or of_word or engine.home_of(last) or of_key or "`clothsim keys` lists the sections."


def _words(name: str) -> set[str]:
    return set(name.replace('"', "").replace(",", "").replace("=", " ").replace(".", " ").split())
