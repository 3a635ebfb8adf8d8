"""Colour scales of the cloth: a diverging one of the stretch, a sequential one of any other quantity."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.render.colormap import DIVERGING, colour_range, painted, ticks

VIRIDIS = np.array(
    [
        [68, 1, 84],
        [72, 24, 106],
        [71, 45, 123],
        [66, 64, 134],
        [59, 82, 139],
        [51, 99, 141],
        [44, 114, 142],
        [38, 130, 142],
        [33, 145, 140],
        [31, 160, 136],
        [40, 174, 128],
        [63, 188, 115],
        [94, 201, 98],
        [132, 212, 75],
        [173, 220, 48],
        [216, 226, 25],
        [253, 231, 37],
    ]
)
"""sRGB of matplotlib's viridis (Smith & van der Walt 2015, CC0), equally spaced: perceptually uniform."""

PREFIXES = {-9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}
"""SI prefixes by the power of ten."""

FLATTEST = 1e-3
"""Smallest width of a range, as a fraction of its values."""
NARROWEST, LARGEST = 1e-4, 1e12
"""Of a range fixed by hand: smallest width as a fraction of its values, and largest number, that the bar can label."""
MOST_STRETCHED = 100.0
"""Of a range of stretches fixed by hand: largest one, and the inverse of the smallest."""


@dataclass(frozen=True)
class Quantity:
    """Name and unit of the numbers that colour a cloth.

    unit: "" for a pure number; log_stretch: True where the numbers are log l of a stretch l.
    """

    name: str
    unit: str = ""
    log_stretch: bool = False


@dataclass(frozen=True)
class Scale:
    """Colours of numbers from `low` to `high`; those beyond take the end colours.

    heading: lines above the bar; ticks: numbers and labels on it, ascending; table: (k, 3) sRGB, equally spaced.
    """

    low: float
    high: float
    heading: tuple[str, ...]
    ticks: tuple[tuple[float, str], ...]
    table: np.ndarray

    def colours(self, values: Floats) -> Floats:
        """The sRGB in [0, 1] of each number, (n, 3)."""
        return painted(values, self.low, self.high, self.table)


Limits = tuple[float, float]
"""Lowest and highest number of a scale that is fixed by hand; of a stretch, stretches."""


def limits_of(given: Any) -> Limits | None:
    """The two numbers of a range fixed by hand, ascending; None where nothing is given.

    Raises
    ------
    InputError
        For other than two finite numbers, the first below the second, or a range that no bar can label.
    """
    if given is None:
        return None
    try:
        low, high = (float(number) for number in given)
    except (TypeError, ValueError) as error:
        raise InputError(f"The range of colours is {given!r:.80}.", "Give two numbers, such as (0.9, 1.1).") from error
    if not (np.isfinite([low, high]).all() and low < high):
        raise InputError(f"The range of colours is {low:g} to {high:g}.", "Give two numbers, the lower one first.")
    largest = max(abs(low), abs(high))
    if largest > LARGEST or high - low < NARROWEST * largest:
        remedy = f"Give numbers up to {LARGEST:g} that differ by {NARROWEST:g} of the larger one or more."
        raise InputError(f"The range of colours is {low:.10g} to {high:.10g}, which no bar can label.", remedy)
    return low, high


def stretch_scale(logs: Iterable[Floats], name: str = "principal stretch", limits: Limits | None = None) -> Scale:
    """The diverging scale of log l that suits all `logs`, centred at l = 1 and labelled with l.

    limits: stretches; the one further from 1 is at an end of the scale.
    """
    if limits is not None and not 1.0 / MOST_STRETCHED <= limits[0] < limits[1] <= MOST_STRETCHED:
        remedy = f"Give stretches from {1.0 / MOST_STRETCHED:g} to {MOST_STRETCHED:g}, such as 0.9,1.1."
        raise InputError(f"The range of stretches is {limits[0]:g} to {limits[1]:g}.", remedy)
    half_range = colour_range(logs) if limits is None else float(np.abs(np.log(limits)).max())
    stretches = ticks(half_range) or [value for value, _ in _ticks(np.exp(-half_range), np.exp(half_range), 1.0)]
    labels = tuple((float(np.log(stretch)), f"{stretch:g}") for stretch in stretches)
    return Scale(-half_range, half_range, tuple(_lines(name)), labels, DIVERGING)


def sequential_scale(quantity: Quantity, values: Iterable[Floats], limits: Limits | None = None) -> Scale:
    """The scale that holds the 1st to 99th percentile of all `values`, from 0 where they nearly begin there.

    limits: lowest and highest number in its place.
    """
    low, high = _percentiles(values) if limits is None else limits
    power, prefix = _prefix(quantity.unit, max(abs(low), abs(high)))
    unit = [f"[{prefix}{quantity.unit}]"] if quantity.unit else []
    return Scale(low, high, (*_lines(quantity.name), *unit), _ticks(low, high, 10.0**power), VIRIDIS)


def _percentiles(values: Iterable[Floats]) -> Limits:
    together = np.concatenate([np.zeros(0), *values])
    low, high = (float(value) for value in np.percentile(together, [1, 99])) if len(together) else (0.0, 0.0)
    if high - low <= FLATTEST * abs(high):  # a few vertices in contact
        low, high = min(low, float(together.min(initial=low))), max(high, float(together.max(initial=high)))
    if 0 <= low < 0.25 * high:
        low = 0.0
    if high - low <= FLATTEST * abs(high):
        middle, half = 0.5 * (low + high), 0.5 * FLATTEST * (abs(high) or 1 / FLATTEST)
        low, high = (0.0, 1.0) if not middle else (middle - half, middle + half)
    return low, high


def _prefix(unit: str, largest: float) -> tuple[int, str]:
    """The power of ten in which numbers up to `largest` are labelled, and its SI prefix; none without a unit."""
    if not unit or not largest:
        return 0, ""
    power = int(np.clip(3 * np.floor((np.log10(largest) + 0.5) / 3), min(PREFIXES), max(PREFIXES)))
    return power, PREFIXES[power]


def _ticks(low: float, high: float, unit: float) -> tuple[tuple[float, str], ...]:
    """Two to six multiples of 1, 2 or 5 times a power of ten (in `unit`) between low and high, with their labels."""
    width = (high - low) / unit
    raw = width / 5
    power = 10.0 ** np.floor(np.log10(raw))
    step = power * next(factor for factor in (1, 2, 5, 10) if factor * power >= raw)
    first, last = int(np.ceil(low / unit / step - 1e-9)), int(np.floor(high / unit / step + 1e-9))
    decimals = max(0, -int(np.floor(np.log10(step) + 1e-9)))
    tiny = decimals > 4 and abs(high) < 1e-3 * unit
    numbers = [k * step for k in range(first, last + 1)]
    return tuple((number * unit, f"{number:.3g}" if tiny else f"{number:.{decimals}f}") for number in numbers)


def _lines(name: str) -> list[str]:
    """The words of a name, short ones together."""
    lines: list[str] = []
    for word in name.split():
        if lines and len(lines[-1]) + len(word) < 12:
            lines[-1] += f" {word}"
        else:
            lines.append(word)
    return lines
