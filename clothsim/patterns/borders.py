"""Borders of panels: samples of their edges by arc length, equally many on both sides of a seam."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.patterns.pattern import Panel, Pattern, Side

# Finer samples where a panel is much narrower than the spacing of the mesh, on both sides of each seam there.

NARROW = 2.5
"""Length of a segment of the border from which on it is divided, as a multiple of the width of the panel there."""
LENGTH = 1.5
"""Length of its parts, as a multiple of the width."""
MOST = 6
"""Bound on the parts of a segment."""
SHORTEST = 1e-100
"""Length of a segment without one: what is wrong with it is said where it is meshed [m]."""
BLOCK = 2**20
"""Largest number of pairs of segments that are held at once."""
WAY = 15.0
"""Way along the border to what faces a point, as a multiple of the width: less is a corner, not a neck."""


def with_necks(pattern: Pattern, fractions: Mapping[Side, Floats]) -> dict[Side, Floats]:
    """Fractions of arc length of the samples of each edge, finer at necks; edges far from any neck stay as they are."""
    parts = {side: np.ones(len(rows) - 1, np.int64) for side, rows in fractions.items()}
    for panel in pattern.panels.values():
        parts |= _parts_of(panel, fractions)
    for stitch in pattern.stitches:
        order = slice(None, None, 1 if stitch.right_wrong else -1)
        most = np.maximum(parts[stitch.first], parts[stitch.second][order])
        parts[stitch.first], parts[stitch.second] = most, most[order]
    return {side: _divided(rows, parts[side]) if parts[side].max() > 1 else rows for side, rows in fractions.items()}


def _parts_of(panel: Panel, fractions: Mapping[Side, Floats]) -> dict[Side, Ints]:
    """Number of parts of each segment of the edges of a panel."""
    edges = [panel.edge_points(k, fractions[Side(panel.name, k)]) for k in range(len(panel.edges))]
    start = np.concatenate([points[:-1] for points in edges])
    side = np.concatenate([np.diff(points, axis=0) for points in edges])
    lengths = np.maximum(np.linalg.norm(side, axis=1), SHORTEST)
    width = np.maximum(_widths(start, side, lengths), lengths / (LENGTH * MOST))
    parts = np.where(lengths > NARROW * width, np.ceil(lengths / (LENGTH * width) - 1e-9), 1).astype(np.int64)
    pieces = np.split(parts, np.cumsum([len(points) - 1 for points in edges])[:-1])
    return {Side(panel.name, k): piece for k, piece in enumerate(pieces)}


def _widths(start: Floats, side: Floats, lengths: Floats) -> Floats:
    """Distance from the middle of each segment of a loop to the nearest one that faces it, (k,) [m]; inf for none."""
    middle, ends = start + side / 2, np.cumsum(lengths)
    found = []
    block = max(1, BLOCK // len(start))
    for first in range(0, len(start), block):
        rows = slice(first, first + block)
        offset = middle[rows, None] - start
        along = np.clip((offset * side).sum(axis=2) / lengths**2, 0, 1)
        distance = np.linalg.norm(offset - along[:, :, None] * side, axis=2)
        way = np.abs((ends - lengths / 2)[rows, None] - (ends - (1 - along) * lengths))
        way = np.minimum(way, ends[-1] - way)
        facing = way > WAY * distance
        facing[np.arange(len(facing)), first + np.arange(len(facing))] = False
        found.append(np.where(facing, distance, np.inf).min(axis=1))
    return np.concatenate(found)


def _divided(fractions: Floats, parts: Ints) -> Floats:
    """Increasing fractions with each gap divided evenly into a number of parts."""
    inner = [a + (b - a) * np.arange(k) / k for a, b, k in zip(fractions, fractions[1:], parts, strict=False)]
    return np.concatenate([*inner, fractions[-1:]])


@dataclass(frozen=True)
class Border:
    """Sampled loop of a panel.

    Attributes
    ----------
    points : (k, 2) array
        Samples in the order of the loop [m].
    starts : (e + 1,) int array
        Sample at which each edge starts; the last entry is k.
    fractions : tuple of (k,) array
        Of each edge, the fractions of its arc length at which its samples are, from 0 to 1.
    graded : bool
        True where some segments are divided at a neck.
    """

    points: Floats
    starts: Ints
    fractions: tuple[Floats, ...]
    graded: bool = False

    def along(self, edge: int) -> Ints:
        """Samples of an edge from its start to its end."""
        return np.arange(self.starts[edge], self.starts[edge + 1] + 1) % len(self.points)

    @property
    def counter_clockwise(self) -> bool:
        """True where the loop encloses a positive area."""
        return enclosed_area(self.points) > 0


def enclosed_area(points: Floats) -> float:
    """Area inside a closed polygon (k, 2) [m2], positive counter-clockwise."""
    following = np.roll(points, -1, axis=0)
    return float((points[:, 0] * following[:, 1] - points[:, 1] * following[:, 0]).sum() / 2)


def segments(pattern: Pattern, spacing: float) -> dict[Side, int]:
    """Number of segments of each edge: segments of a length of at most `spacing` [m] on the longer side of a seam."""
    counts = {
        Side(name, number): max(1, int(np.ceil(panel.edge_length(number) / spacing - 1e-9)))
        for name, panel in pattern.panels.items()
        for number in range(len(panel.edges))
    }
    for stitch in pattern.stitches:
        counts[stitch.first] = counts[stitch.second] = max(counts[side] for side in stitch.sides)
    return counts


def borders(pattern: Pattern, spacing: float) -> dict[str, Border]:
    """Border of each panel, with the segments of `segments`, which are divided at necks."""
    even = {side: np.arange(count + 1) / count for side, count in segments(pattern, spacing).items()}
    fractions = with_necks(pattern, even)
    return {name: _border(panel, fractions, even) for name, panel in pattern.panels.items()}


def _border(panel: Panel, fractions: Mapping[Side, Floats], even: Mapping[Side, Floats]) -> Border:
    sides = [Side(panel.name, number) for number in range(len(panel.edges))]
    rows = tuple(fractions[side] for side in sides)
    points = [panel.edge_points(side.edge, row[:-1]) for side, row in zip(sides, rows, strict=True)]
    starts = np.cumsum([0, *(len(row) - 1 for row in rows)])
    graded = any(len(row) > len(even[side]) for side, row in zip(sides, rows, strict=True))
    return Border(np.concatenate(points), starts, rows, graded)
