"""Colour map of stretches: diverging in log l, centred at l = 1, range from the data."""

from collections.abc import Iterable

import numpy as np

from clothsim.base.arrays import Floats, Ints

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
    edges1 = positions[triangles[:, 1]] - positions[triangles[:, 0]]
    edges2 = positions[triangles[:, 2]] - positions[triangles[:, 0]]
    area = np.repeat(np.linalg.norm(np.cross(edges1, edges2), axis=1), 3)
    corners = triangles.ravel()
    total = np.bincount(corners, weights=area, minlength=len(positions))
    summed = np.bincount(corners, weights=area * np.repeat(values, 3), minlength=len(positions))
    return np.divide(summed, total, out=np.zeros(len(positions)), where=total > 0)
