"""Sections and keys of a scene by name: the nearest known one where there is none."""

import json
from difflib import get_close_matches
from typing import Any, Literal

from clothsim.base.errors import InputError
from clothsim.base.inputs import nearest
from clothsim.keys.section_hints import home_of
from clothsim.scene.json_schema import json_schema
from clothsim.scene.reference import COLUMNS, Section, markdown, row, sections

SIMILAR = 0.75
"""Similarity, from 0 to 1, from which on a name is taken for another one misspelt."""


def reference_text(form: Literal["markdown", "json"]) -> str:
    """The reference of all sections: a page in Markdown, or a JSON schema for editors."""
    return markdown() if form == "markdown" else json.dumps(json_schema(), indent=2)


def reference(name: str | None = None) -> dict[str, Any]:
    """The sections whose name is `name` or holds it as a word, or all; "solver.dt" is one key.

    Returns
    -------
    dict
        {section: {"summary": ..., "keys": {key: {column: text}}}}, the COLUMNS but the first.

    Raises
    ------
    InputError
        For a name that is no section and no key, with the nearest known one.
    """
    matching, only = (list(sections().values()), None) if name is None else _matching(name)
    return {
        section.name: {
            "summary": section.summary,
            "keys": {
                key.name: dict(zip(COLUMNS[1:], row(key)[1:], strict=True))
                for key in section.keys.values()
                if only in (None, key.name)
            },
        }
        for section in matching
    }


def _matching(name: str) -> tuple[list[Section], str | None]:
    """The sections of a name, and the name of the only key that is meant. InputError for an unknown one."""
    known = sections()
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
    known = sections()
    words = {word for section in known for word in _words(section)}
    keys = {f"{section.name}.{key}" for section in known.values() for key in section.keys}
    last = name.rpartition(".")[2]
    of_name = nearest(name, [*known, *sorted(keys)], SIMILAR) if "." in name else ""
    of_word = nearest(last, sorted(words), SIMILAR)
    close = get_close_matches(last, {key.rpartition(".")[2] for key in keys}, n=1, cutoff=SIMILAR)
    of_key = home_of(close[0]) if close else ""
    return of_name or of_word or home_of(last) or of_key or "`clothsim keys` lists the sections."


def _words(name: str) -> set[str]:
    return set(name.replace('"', "").replace(",", "").replace("=", " ").replace(".", " ").split())
