"""Borders of panels: samples of their edges by arc length, equally many on both sides of a seam."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.patterns.necks import with_necks
from clothsim.patterns.pattern import Panel, Pattern, Side


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
