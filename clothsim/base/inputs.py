"""Values that a user gave: their kind, and how a message shows them."""

import difflib
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from clothsim.base.errors import InputError

LONGEST = 120
"""Letters of a value in a message."""


def nearest(name: Any, known: Iterable[str], least: float = 0.5) -> str:
    """A question for the nearest known name; empty where none is at least that similar, from 0 to 1."""
    close = difflib.get_close_matches(str(name), list(known), n=1, cutoff=least)
    return f"Did you mean {close[0]!r}?" if close else ""


def nearest_or_known(where: str, key: str, known: list[str]) -> str:
    """The remedy for an unknown key: the nearest known one, else all."""
    return nearest(key, known) or (f"Known: {', '.join(known)}." if known else f"{where} takes no keys.")


def refuse_unknown(
    where: str,
    given: Iterable[str],
    known: Iterable[str],
    remedy: Callable[[str, str, list[str]], str] = nearest_or_known,
) -> None:
    """InputError for the first key of `given` that is not `known`."""
    names = list(known)
    for key in given:
        if key not in names:
            raise InputError(f"{where} has no key {key!r}.", remedy(where, str(key), names))


def table(where: str, value: Any, remedy: str = "") -> Mapping[str, Any]:
    """`value` as a table of keys; InputError otherwise."""
    if not isinstance(value, Mapping):
        hint = remedy or f"Write its keys under [{where}]."
        raise InputError(f"{where} must be a table of keys, not {shown(value)}.", hint)
    return value


def shown(value: Any) -> str:
    """A value in a message: on one line and short, of an array its shape."""
    if getattr(value, "shape", ()):
        return f"an array of shape {value.shape}"
    text = " ".join(repr(value).split())
    return text if len(text) <= LONGEST else f"{text[: LONGEST // 2]} ... {text[-LONGEST // 2 :]}"


def refuse_uncallable(**callbacks: Any) -> None:
    """InputError for a callback that is neither None nor callable.

    Parameters
    ----------
    **callbacks
        Each by the name of its argument.
    """
    for name, value in callbacks.items():
        if value is not None and not callable(value):
            raise InputError(f"{name} is {value!r:.80}, which cannot be called.", f"Give a function: {name}=print.")
