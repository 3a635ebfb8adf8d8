"""Checks of the keys and values that a scene names; an unknown one is answered with the nearest known one."""

import difflib
from collections.abc import Iterable, Mapping
from dataclasses import MISSING, fields
from typing import Any, TypeVar

from clothsim.arrays import as_positive
from clothsim.errors import InputError

T = TypeVar("T")

DEEPEST = 12
"""Tables and lists within one another."""

MOST = 10**6
"""The largest count that a setting may have."""


def refuse_unknown(where: str, given: Iterable[str], known: Iterable[str]) -> None:
    """InputError for the first key of `given` that is not `known`, with the nearest known one."""
    names = list(known)
    for key in given:
        if key not in names:
            close = difflib.get_close_matches(str(key), names, n=1, cutoff=0.5)
            hint = f"Did you mean {close[0]!r}?" if close else f"Known: {', '.join(names)}."
            raise InputError(f"{where} has no key {key!r}.", hint)


def refuse_deep(where: str, value: Any) -> None:
    """InputError for tables and lists nested in more than DEEPEST others: no key of a scene is."""
    level = [value]
    for _ in range(DEEPEST):
        level = [inner for outer in level for inner in _inner(outer)]
        if not level:
            return
    raise InputError(f"{where} holds tables or lists in more than {DEEPEST} others.", "Write it flat.")


def _inner(value: Any) -> Iterable[Any]:
    if isinstance(value, Mapping):
        return value.values()
    return value if isinstance(value, list | tuple) else ()


def table(where: str, value: Any) -> Mapping[str, Any]:
    """`value` as a table of keys; InputError otherwise."""
    if not isinstance(value, Mapping):
        raise InputError(f"{where} must be a table of keys, not {value!r}.")
    return value


def settings(kind: type[T], where: str, given: Any) -> T:
    """A frozen dataclass from a table: unknown keys and values of another type than the default's are refused."""
    keys = table(where, given)
    known = {field.name.rstrip("_"): field for field in fields(kind)}  # type: ignore[arg-type]
    refuse_unknown(where, keys, known)
    values = {}
    for key, value in keys.items():
        field = known[key]
        default = field.default if field.default is not MISSING else None
        values[field.name] = _alike(f"{where}.{key}", value, default)
    return kind(**values)


def _alike(name: str, value: Any, default: Any) -> Any:
    """`value` in the type of `default`: numbers may be whole, everything else must match."""
    if isinstance(default, bool) or not isinstance(default, (int, float)):
        if default is not None and not isinstance(value, type(default)):
            raise InputError(f"{name} must be {_TYPES.get(type(default), 'of another type')}, not {value!r}.")
        return value
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise InputError(f"{name} must be a number, not {value!r}.")
    if isinstance(default, int):
        if not 0 <= value <= MOST or value != int(value):
            raise InputError(f"{name} must be a whole number from 0 to {MOST:,}, not {value!r}.")
        return int(value)
    return as_positive(name, value)


_TYPES = {str: "a text", bool: "true or false", tuple: "a list"}
