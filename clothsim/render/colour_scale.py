"""Colour scales of the cloth: diverging in log l of the stretch l, sequential of any other quantity."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.base.triangles import thirds_at_vertices, triangle_areas

DIVERGING = np.array(
    [
        [24, 62, 128],
        [37, 97, 168],
        [76, 140, 197],
        [139, 184, 220],
        [190, 211, 228],
        [228, 227, 223],
        [240, 205, 183],
        [239, 170, 136],
        [221, 118, 88],
        [188, 66, 52],
        [140, 26, 38],
    ]
)
"""sRGB, blue (l < 1) over a light warm grey (l = 1) to red (l > 1), equally spaced; blue-red is colour-blind safe."""

_TICKS = {
    0.01: (0.99, 0.995, 1.0, 1.005, 1.01),
    0.02: (0.98, 0.99, 1.0, 1.01, 1.02),
    0.03: (0.97, 0.985, 1.0, 1.015, 1.03),
    0.05: (0.95, 0.975, 1.0, 1.025, 1.05),
    0.1: (0.9, 0.95, 1.0, 1.05, 1.1),
    0.2: (0.8, 0.9, 1.0, 1.1, 1.2),
    0.3: (0.7, 0.85, 1.0, 1.15, 1.3, 1.4),
    0.5: (0.5, 0.7, 1.0, 1.4, 2.0),
    0.75: (0.25, 0.5, 1.0, 2.0, 4.0),
    0.9: (0.1, 0.3, 1.0, 3.0, 10.0),
}
"""Labels of the bar of range (1 - p, 1 / (1 - p)), by p."""


def log_stretch(principal_stretches: Floats) -> Floats:
    """log l of the principal stretch farthest from 1 in |log l|, signed, (m,); a collapsed one counts as 1e-6."""
    logs = np.log(np.maximum(principal_stretches, 1e-6))
    farthest = np.argmax(np.abs(logs), axis=1)
    return np.take_along_axis(logs, farthest[:, None], axis=1)[:, 0]


def colour_range(logs: Iterable[Floats]) -> float:
    """Half the width of the colour range in log l: where the bar ends at 1 - p and 1 / (1 - p) for a round p.

    The smallest such range that holds the 1st to 99th percentile of all `logs`, and never less than 1 %.
    """
    values = np.concatenate([np.zeros(1), *logs])
    largest = float(np.abs(np.percentile(values, [1, 99])).max())
    ranges = [-np.log1p(-p) for p in _TICKS]
    return next((float(r) for r in ranges if r >= largest), float(ranges[-1]))


def ticks(half_range: float) -> tuple[float, ...]:
    """The stretches to label on a bar, ascending: of the widest range of `colour_range` within it; () for none."""
    within = [p for p in _TICKS if -np.log1p(-p) <= half_range * (1 + 1e-9)]
    return _TICKS[within[-1]] if within else ()


def stretch_colours(logs: Floats, half_range: float) -> Floats:
    """sRGB in [0, 1] of each log l, (n, 3); values beyond the range take its end colours."""
    return painted(logs, -half_range, half_range, DIVERGING)


def painted(values: Floats, low: float, high: float, table: np.ndarray) -> Floats:
    """sRGB in [0, 1] of each number, (n, 3), by a table (k, 3) of equally spaced colours from low to high."""
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    fraction = np.clip(0.5 + 0.5 * (values - middle) / half, 0.0, 1.0)
    knots = np.linspace(0, 1, len(table))
    return np.column_stack([np.interp(fraction, knots, channel / 255.0) for channel in table.T])


def per_vertex(values: Floats, positions: Floats, triangles: Ints) -> Floats:
    """Values (m,) of triangles as means at the vertices (n,), weighted by area; 0 at a vertex without area."""
    areas = triangle_areas(positions[triangles])
    total, summed = (thirds_at_vertices(each, triangles, len(positions)) for each in (areas, areas * values))
    return np.divide(summed, total, out=np.zeros(len(positions)), where=total > 0)


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

    InputError for other than two finite numbers, the first below the second, or a range that no bar can label.
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
        raise InputError(f"The range of colours is {low:.10g} to {high:.10g}, which a colour bar cannot label.", remedy)
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
