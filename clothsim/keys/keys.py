"""Names that a scene may use: an unknown one is answered with the nearest known one."""

from collections.abc import Iterable, Mapping
from typing import Any

from clothsim.base import inputs
from clothsim.base.errors import InputError
from clothsim.base.inputs import nearest

DEEPEST = 12
"""Largest depth of nested tables and lists."""


def refuse_unknown(where: str, given: Iterable[str], known: Iterable[str]) -> None:
    """InputError for the first key of `given` that is not `known`, with the nearest known one."""
    inputs.refuse_unknown(where, given, known, _hint)


def refuse_absent(kind: str, name: Any, names: Iterable[str]) -> None:
    """InputError where none of the objects of a `kind` ("cloth", "group of pins") has this name; lists those there."""
    known = list(names)
    if name not in known:
        listed = f"There {'is' if len(known) == 1 else 'are'} {', '.join(map(repr, known))}." if known else ""
        question = nearest(name, known)
        raise InputError(f"There is no {kind} {name!r}.", f"{question} {listed}".strip() or f"The scene has no {kind}.")


def _hint(where: str, key: str, names: list[str]) -> str:
    """The remedy for an unknown key: one very near, the section that has it, one near, or all that are known."""
    from clothsim.keys.section_hints import home_of

    known = f"Known: {', '.join(names)}." if names else f"{where} takes no keys."
    return nearest(key, names, 0.75) or home_of(key) or nearest(key, names) or known


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
