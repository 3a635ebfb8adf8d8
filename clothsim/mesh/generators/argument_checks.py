"""Checks of a mesh generator's arguments; each error names the key."""

import operator
from collections.abc import Sequence

from clothsim.base.arrays import as_positive
from clothsim.base.errors import InputError


def as_lengths(name: str, values: Sequence[float], count: int) -> tuple[float, ...]:
    """Return `count` lengths above zero [m]; InputError names the key and the entry."""
    return tuple(as_positive(f"{name}[{k}]", value) for k, value in enumerate(_entries(name, values, count, "numbers")))


def as_counts(name: str, values: Sequence[int], count: int, least: int = 1) -> tuple[int, ...]:
    """Return `count` whole numbers from `least` to 4096; InputError names the key and the entry."""
    entries = _entries(name, values, count, "whole numbers")
    return tuple(as_count(f"{name}[{k}]", value, least) for k, value in enumerate(entries))


def as_count(name: str, value: int, least: int = 1, most: int = 4096) -> int:
    """Return one whole number from `least` to `most`; the bound keeps a typing error from filling the memory."""
    try:
        number = operator.index(value)
    except TypeError as error:
        raise InputError(f"{name} must be a whole number, not {value!r}.") from error
    if isinstance(value, bool) or not least <= number <= most:
        raise InputError(f"{name} must be a whole number from {least} to {most}, not {value!r}.")
    return number


def _entries(name: str, values: Sequence, count: int, what: str) -> list:
    try:
        entries = list(values)
    except TypeError as error:
        raise InputError(f"{name} must be {count} {what}, not {values!r}.") from error
    if isinstance(values, str) or len(entries) != count:
        raise InputError(f"{name} must be {count} {what}, not {values!r}.")
    return entries
