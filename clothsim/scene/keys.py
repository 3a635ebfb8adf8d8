"""Names that a scene may use: an unknown one is answered with the nearest known one."""

import difflib
from collections.abc import Iterable, Mapping
from typing import Any

from clothsim.errors import InputError

DEEPEST = 12
"""Largest depth of nested tables and lists."""


def refuse_unknown(where: str, given: Iterable[str], known: Iterable[str]) -> None:
    """InputError for the first key of `given` that is not `known`, with the nearest known one."""
    names = list(known)
    for key in given:
        if key not in names:
            hint = nearest(key, names) or (f"Known: {', '.join(names)}." if names else "It takes no keys.")
            raise InputError(f"{where} has no key {key!r}.", hint)


def nearest(name: Any, known: Iterable[str]) -> str:
    """A question for the nearest known name; empty where none is near."""
    close = difflib.get_close_matches(str(name), list(known), n=1, cutoff=0.5)
    return f"Did you mean {close[0]!r}?" if close else ""


def refuse_deep(where: str, value: Any) -> None:
    """InputError for tables and lists nested deeper than DEEPEST: no key of a scene is."""
    level = [value]
    for _ in range(DEEPEST):
        level = [inner for outer in level for inner in _inner(outer)]
        if not level:
            return
    raise InputError(f"{where} holds tables or lists nested deeper than {DEEPEST}.", "Write it flat.")


def _inner(value: Any) -> Iterable[Any]:
    if isinstance(value, Mapping):
        return value.values()
    return value if isinstance(value, list | tuple) else ()


def table(where: str, value: Any, remedy: str = "") -> Mapping[str, Any]:
    """`value` as a table of keys; InputError otherwise."""
    if not isinstance(value, Mapping):
        hint = remedy or f"Write its keys under [{where}]."
        raise InputError(f"{where} must be a table of keys, not {value!r}.", hint)
    return value
