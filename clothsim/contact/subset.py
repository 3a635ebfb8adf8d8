"""The pairs around a few vertices that move while all others stand."""

from dataclasses import dataclass
from time import perf_counter
from typing import Any, Self

import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.contact.barrier_kernels import near_pairs
from clothsim.contact.candidates import Candidates
from clothsim.contact.filter import keeps_to
from clothsim.contact.search import Pairs

REACH = 3.0
"""How far they may go on one list, in `reach` of the whole surface."""


@dataclass(frozen=True)
class CandidatesAround:
    """The candidates of a whole surface, `active` gives those that a `moving` vertex ((N,) booleans) belongs to.

    start (N, 3) [m]: where all pairs of theirs are known that are closer than limit + 2 radius: while they stay within
    `radius` [m] of it, nothing is searched. Beyond it, the whole is asked.
    """

    whole: Candidates
    moving: np.ndarray
    rows: Ints
    start: Floats
    radius: float
    pairs: Pairs

    @classmethod
    def of(cls, whole: Candidates, moving: np.ndarray, x: Floats) -> Self:
        """Those around x (N, 3) [m]."""
        began, radius = perf_counter(), REACH * whole.reach
        mine = np.zeros_like(moving)
        mine[whole.surface.first.points] = moving[whole.surface.first.points]
        pairs, _ = whole.search.pairs(x, x, whole.limit + 2.0 * radius, mine)
        whole.seconds["candidates"] += perf_counter() - began
        return cls(whole, moving, np.flatnonzero(moving), x.copy(), radius, pairs)

    def active(self, x: Floats) -> Pairs:
        """The pairs closer than `limit` at x that can change."""
        if not self._holds(x):
            near = self.whole.active(x)
            return near.at(np.flatnonzero(np.logical_or.reduce([self.moving.take(rows) for rows in near.elements.T])))
        numbers, _ = near_pairs(x, self.pairs.elements, self.pairs.n_points, self.whole.limit)
        return self.pairs.at(numbers)

    def step_limit(self, x: Floats, dx: Floats, most: float = 1.0) -> float:
        """The fraction of dx, which moves them alone and counts up to `most`, that is free of collision."""
        if not (self._holds(x) and self._holds(x + dx)):
            return self.whole.step_limit(x, dx, most)
        return self.whole.free(self.pairs, x, dx, most)

    def _holds(self, x: Floats) -> bool:
        """Whether all of them are within `radius` of where the list was made."""
        return keeps_to(x, self.start, self.start, self.rows, self.radius)

    def __getattr__(self, name: str) -> Any:
        """All else is asked of the whole."""
        return getattr(self.whole, name)
