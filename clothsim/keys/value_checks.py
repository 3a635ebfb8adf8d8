"""Checks of names and values against the schema: unknown and missing keys, types, ranges, choices, nested tables."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, get_args, get_origin

import numpy as np

from clothsim.base import inputs
from clothsim.base.errors import InputError
from clothsim.base.inputs import did_you_mean, shown
from clothsim.keys.schema import FUNCTION, SceneKey, choices, keys_of, members, type_in_words

DEEPEST = 12
"""Largest depth of nested tables and lists."""


def refuse_unknown_key(where: str, given: Iterable[str], known: Iterable[str]) -> None:
    """InputError for the first key of `given` that is not `known`, with the nearest known one."""
    inputs.refuse_unknown(where, given, known, _hint)


def refuse_absent(kind: str, name: Any, names: Iterable[str]) -> None:
    """InputError where none of the objects of a `kind` ("cloth", "group of pins") has this name; lists those there."""
    known = list(names)
    if name not in known:
        listed = f"There {'is' if len(known) == 1 else 'are'} {', '.join(map(repr, known))}." if known else ""
        question = did_you_mean(name, known)
        raise InputError(f"There is no {kind} {name!r}.", f"{question} {listed}".strip() or f"The scene has no {kind}.")


def _hint(where: str, key: str, names: list[str]) -> str:
    """The remedy for an unknown key: one very near, the section that has it, one near, or all that are known."""
    from clothsim.keys.section_hints import home_of

    known = f"Known: {', '.join(names)}." if names else f"{where} takes no keys."
    longer = [name for name in names if name.startswith(f"{key}_")]  # cloth.bending is no effect, nor a key
    if len(longer) == 1:
        return f"Did you mean {longer[0]!r}?"
    few = ", ".join(longer[:3]) + (" and others" if len(longer) > 3 else "")
    begun = f"Keys of {where} that begin like this: {few}. " if longer else ""
    return did_you_mean(key, names, 0.75) or f"{begun}{home_of(key)}".strip() or did_you_mean(key, names) or known


def refuse_deep(where: str, value: Any) -> None:
    """InputError for tables and lists nested deeper than DEEPEST: no key of a scene is."""
    level = [value]
    for _ in range(DEEPEST):
        nested = [each for each in level if isinstance(each, Mapping | list | tuple)]
        level = [inner for each in nested for inner in (each.values() if isinstance(each, Mapping) else each)]
        if not level:
            return
    raise InputError(f"{where} holds tables or lists nested deeper than {DEEPEST}.", "Write it flat.")


MOST = 10**6
"""The largest count that a setting may have."""


def refuse_missing(where: str, keys: Mapping[str, Any], section: type) -> None:
    """InputError for the first key that a section needs and a table does not have."""
    for name, known in keys_of(section).items():
        if known.required and name not in keys:
            raise InputError(f"{where} has no {name}.", f"{name}: {known.key.meaning}; give {_a_type(known)}.")


def check_value(where: str, value: Any, known: SceneKey) -> Any:
    """A value of a key: a float, an int, the sections of nested tables, else as it is. InputError names `where`."""
    parts, key = members(known.annotation), known.key
    lists = [get_args(part)[0] for part in parts if get_origin(part) is Sequence]
    entry = lists[0] if len(lists) == 1 and (lists[0] in (int, float) or choices(lists[0])) else None
    if isinstance(value, bool | np.bool_):
        if bool in parts:
            return bool(value)
    elif _is_number(value):
        if float in parts or int in parts:
            return _in_range(where, value, known, whole=float not in parts)
    elif isinstance(value, str):
        return _word(where, value, known)
    elif isinstance(value, list | tuple | np.ndarray) and entry is not None:
        _each(where, value, known, entry)
        return value
    elif key.tables and not (isinstance(value, Mapping) and set(value) == {FUNCTION}):
        return _nested(where, value, known)
    elif any(_accepts(part, value) for part in parts):
        return value  # of {function = "name"}, from the text of a run, the effect reports that the function is lost
    raise _wrong_type(where, value, known)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float | np.integer | np.floating)


def _in_range(where: str, value: Any, known: SceneKey, whole: bool) -> float | int:
    """The number as a float, or as an int where it must be whole."""
    key = known.key
    if whole:
        least, most = int(key.least or 0), MOST if key.most is None else int(key.most)
        if not (least <= value <= most and value == int(value)):
            span = f"a whole number from {least:,} to {most:,}"
            raise InputError(f"{where} must be {span}, not {shown(value)}.", _example(where, known))
        return int(value)
    try:
        number = float(value)
    except OverflowError as error:
        raise InputError(f"{where} must be a number that a float can hold.", _example(where, known)) from error
    if not (math.isfinite(number) and key.contains(number)):
        unit = "" if key.unit in ("-", "1") else f" [{key.unit}]"
        raise InputError(f"{where} must be {key.range or 'finite'}{unit}, not {shown(value)}.", _example(where, known))
    return number


def _word(where: str, value: str, known: SceneKey) -> str:
    """A text: one of the choices, or any that can be printed."""
    words = choices(known.annotation)
    if value in words:
        return value
    if str in members(known.annotation):
        if not value.isprintable():
            raise InputError(f"{where} is {value!r}, which cannot be printed.", "Give text of printable letters.")
        return value
    if not words:
        raise _wrong_type(where, value, known)
    raise _unknown_word(where, value, words, type_in_words(known.annotation, known.key))


def _unknown_word(where: str, value: Any, words: Sequence[str], listed: str) -> InputError:
    """The error for a value that is none of the choices, with the nearest of them."""
    return InputError(f"{where} is {shown(value)}.", f"{did_you_mean(value, words)} Known: {listed}.".strip())


def _nested(where: str, value: Any, known: SceneKey) -> Any:
    """The section of a table, or those of a list of tables, that the key names."""
    several = any(get_origin(part) is Sequence for part in members(known.annotation))
    sections: tuple[Any, ...] = known.key.tables
    if isinstance(value, sections):
        return value
    if len(sections) > 1 or not several:
        if isinstance(value, Mapping) and len(sections) == 1:
            return sections[0].parsed(where, value)
        if isinstance(value, Mapping):
            by_kind = {keys_of(section)["kind"].default: section for section in sections}
            kind = value.get("kind")
            if not isinstance(kind, str) or kind not in by_kind:
                raise InputError(f"{where}.kind is {kind!r}.", f"Known: {', '.join(by_kind)}; or give a vector.")
            return by_kind[kind].parsed(where, value)
        if any(_accepts(part, value) for part in members(known.annotation)):
            return value
        raise _wrong_type(where, value, known)
    if isinstance(value, Mapping) or not isinstance(value, list | tuple):
        raise _wrong_type(where, value, known)
    return tuple(
        entry if isinstance(entry, sections) else sections[0].parsed(f"{where}[{number}]", entry)
        for number, entry in enumerate(value)
    )


def _each(where: str, values: Any, known: SceneKey, entry: type) -> None:
    """InputError unless a list has its length, and each entry its type and range."""
    words = choices(entry)
    for index, word in enumerate(values if words else ()):
        if word not in words:
            raise _unknown_word(f"{where}[{index}]", word, words, " | ".join(words))
    length, numbers = known.key.length, np.ndim(np.asarray(values, object))
    if length is None:
        return
    if numbers != 1 or len(values) != length:
        raise _wrong_type(where, values, known)
    for index, value in enumerate(values):
        if not _is_number(value) or isinstance(value, bool):
            kind = "a whole number" if entry is int else "a number"
            raise InputError(f"{where}[{index}] must be {kind}, not {shown(value)}.", _example(where, known))
        _in_range(f"{where}[{index}]", value, known, whole=entry is int)


def _accepts(part: Any, value: Any) -> bool:
    """True where a value that is neither a number nor a text may be of the type."""
    origin = get_origin(part) or part
    if isinstance(value, Mapping) and set(value) == {FUNCTION}:
        return origin is Callable
    if origin is Sequence or origin is np.ndarray:
        return isinstance(value, list | tuple | np.ndarray | range)
    if origin is Mapping:
        return isinstance(value, Mapping)
    if origin is Callable:
        return callable(value)
    return part is Any


def _wrong_type(where: str, value: Any, known: SceneKey) -> InputError:
    """The error for a value of another type, with an example of a right one."""
    kind = _a_type(known)
    unit = "" if known.key.unit in ("-", "1") else f" [{known.key.unit}]"
    return InputError(f"{where} must be {kind}{unit}, not {shown(value)}.", _example(where, known))


def _example(where: str, known: SceneKey) -> str:
    """A remedy that shows how the key is written."""
    if known.key.tables:
        names = "; or ".join(", ".join(keys_of(section)) for section in known.key.tables)
        several = any(
            get_origin(part) is Sequence and get_args(part)[0] is not float for part in members(known.annotation)
        )
        return f"Write [[{where}]], each a table with {names}." if several else f"Its keys are {names}."
    if known.key.shown:
        none, _, instead = known.key.shown.partition(": ")
        without = f"without it {instead or 'there is none'}" if none == "none" else f"the default is {known.key.shown}"
        return f"{known.name}: {known.key.meaning}; {without}."
    if known.required or known.default == ():
        return f"{known.name}: {known.key.meaning}."
    return f"{known.name}: {known.key.meaning}; the default is {as_toml(known.default)}."


def _a_type(known: SceneKey) -> str:
    """The type of a key with its article."""
    kind = type_in_words(known.annotation, known.key)
    return kind if kind[:1].isdigit() or kind.startswith(("true", '"', "rows")) else f"a {kind}"


def as_toml(value: Any) -> str:
    """A default as a scene file writes it."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, list | tuple | np.ndarray):
        return f"[{', '.join(as_toml(entry) for entry in value)}]"
    return f"{value:g}" if isinstance(value, float) else str(value)
