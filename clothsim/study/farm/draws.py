"""Random draws of scene keys: one stream for each seed, index and key."""

import math
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from clothsim.base.errors import InputError
from clothsim.engine import refuse_unknown, shown

KINDS = ("uniform", "log_uniform", "normal", "choice", "grid")


class Draw(Protocol):
    """Distribution of the values of a key."""

    def value(self, stream: np.random.Generator) -> Any:
        """One value."""

    @property
    def box(self) -> tuple[float, float] | None:
        """Least and largest value; None where the values are no numbers."""


@dataclass(frozen=True)
class Interval:
    """Uniform, log-uniform or normal numbers from `low` to `high`; a normal one is drawn again outside of them."""

    kind: str
    low: float
    high: float
    mean: float = 0.0
    deviation: float = 0.0

    def value(self, stream: np.random.Generator) -> float:
        """One number, rounded to 12 digits, so that its text is short and its own."""
        if self.kind == "log_uniform":
            drawn = math.exp(stream.uniform(math.log(self.low), math.log(self.high)))
        elif self.kind == "normal":
            drawn = _truncated(stream, self)
        else:
            drawn = stream.uniform(self.low, self.high)
        return float(f"{drawn:.12g}")

    @property
    def box(self) -> tuple[float, float]:
        """The ends."""
        return self.low, self.high


@dataclass(frozen=True)
class Choice:
    """One of some values, all equally probable; `in_order`: the values of a grid, taken one by one."""

    values: tuple[Any, ...]
    in_order: bool = False

    def value(self, stream: np.random.Generator) -> Any:
        """One of the values."""
        return self.values[int(stream.integers(len(self.values)))]

    @property
    def box(self) -> tuple[float, float] | None:
        """Least and largest of the numbers."""
        numbers = [each for each in self.values if isinstance(each, int | float) and not isinstance(each, bool)]
        return (min(numbers), max(numbers)) if len(numbers) == len(self.values) else None


def stream_of(seed: int, index: int, key: str) -> np.random.Generator:
    """The random numbers of one key of one drape: a further varied key changes those of no other."""
    return np.random.default_rng([seed, index, zlib.crc32(key.encode())])


def draw_of(key: str, given: Any) -> Draw:
    """The distribution of an entry of [vary].

    Parameters
    ----------
    key : str
        The varied key.
    given : list or table
        [a, b, c] is a choice; { uniform = [lo, hi] }, { log_uniform = [lo, hi] }, { normal = [mean, deviation] } within
        2.5 deviations, { choice = [...] }, { grid = [...] }.

    Raises
    ------
    InputError
        For another entry.

    Examples
    --------
    >>> draw_of("body.chest", {"uniform": [0.95, 1.08]}).box
    (0.95, 1.08)
    >>> draw_of("cloth.fabric", ["cotton", "denim"]).values
    ('cotton', 'denim')
    """
    where = f"vary.{key!r}"
    if isinstance(given, list | tuple):
        return Choice(_values(where, given))
    if not isinstance(given, Mapping) or len(given) != 1:
        raise InputError(f"{where} is {shown(given)}.", 'Write { uniform = [lo, hi] }, a list of values, or "=key".')
    ((kind, numbers),) = given.items()
    refuse_unknown(where, [kind], KINDS)
    if kind in ("choice", "grid"):
        return Choice(_values(where, numbers), kind == "grid")
    a, b = _pair(f"{where}.{kind}", numbers)
    if kind == "normal":
        if b <= 0:
            raise InputError(f"{where}: the deviation is {b:g}.", "Give a positive one.")
        return Interval(kind, a - 2.5 * b, a + 2.5 * b, a, b)
    if not a < b or (kind == "log_uniform" and a <= 0):
        raise InputError(f"{where}: {kind} = [{a:g}, {b:g}] is no interval.", "Give the lower end, then the upper one.")
    return Interval(kind, a, b)


def _truncated(stream: np.random.Generator, of: Interval) -> float:
    """A normal number within 2.5 deviations; 1 in 80 draws is outside, so that 64 in a row do not occur."""
    for _ in range(64):
        drawn = stream.normal(of.mean, of.deviation)
        if of.low <= drawn <= of.high:
            return float(drawn)
    return of.mean


def _pair(where: str, given: Any) -> tuple[float, float]:
    numbers = list(given) if isinstance(given, list | tuple) else []
    if len(numbers) != 2 or not all(isinstance(n, int | float) and math.isfinite(n) for n in numbers):
        raise InputError(f"{where} is {shown(given)}.", "Give two numbers.")
    return float(numbers[0]), float(numbers[1])


def _values(where: str, given: Any) -> tuple[Any, ...]:
    values = tuple(given) if isinstance(given, list | tuple) else ()
    if not values or any(isinstance(value, Mapping) for value in values):
        raise InputError(f"{where} is {shown(given)}.", "Give a list of numbers, texts or vectors.")
    return values
