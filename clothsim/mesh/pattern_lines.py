"""Named vertices of a cloth that was meshed from a sewing pattern: edges of panels, labels, and seams that are open."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from clothsim.base.arrays import Ints


@dataclass(frozen=True)
class PatternLines:
    """Vertices of a cloth by their names in its pattern.

    Attributes
    ----------
    edges : mapping of (str, int) to (k,) int array
        Vertices of each edge of a panel, from its start to its end.
    labels : mapping of str to tuple of (str, int)
        Edges of each label, such as "lower_interface".
    open_seams : mapping of str to (k, 2) int array
        Vertices that a seam joins, where it is not welded yet.
    """

    edges: Mapping[tuple[str, int], Ints] = field(default_factory=dict)
    labels: Mapping[str, tuple[tuple[str, int], ...]] = field(default_factory=dict)
    open_seams: Mapping[str, Ints] = field(default_factory=dict)

    def labelled(self, label: str) -> Ints:
        """Vertices of all edges of a label, (k,), ascending."""
        return np.unique(np.concatenate([self.edges[name] for name in self.labels[label]]))

    def segments(self, names: Iterable[tuple[str, int]]) -> Ints:
        """Neighbouring vertices along edges of panels, (k, 2); a pair of two edges that are welded comes twice."""
        sides = [self.edges[name] for name in names]
        return np.concatenate([np.zeros((0, 2), np.int64), *(np.column_stack([s[:-1], s[1:]]) for s in sides)])

    def renumbered(self, number: Ints) -> "PatternLines":
        """Copy in which vertex i has become number[i], or has gone where that is -1."""
        pairs = {name: number[rows] for name, rows in self.open_seams.items()}
        pairs = {name: rows[(rows >= 0).all(axis=1) & (rows[:, 0] != rows[:, 1])] for name, rows in pairs.items()}
        return PatternLines(
            {name: _left(number[rows]) for name, rows in self.edges.items()},
            self.labels,
            {name: rows for name, rows in pairs.items() if len(rows)},
        )


def _left(rows: Ints) -> Ints:
    return rows[rows >= 0]
