"""Candidates incident to a few moving vertices while all others stand still."""

from dataclasses import dataclass
from time import perf_counter
from typing import Any, Self

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.physics.contact.barrier_kernels import pairs_within
from clothsim.physics.contact.candidates import Candidates
from clothsim.physics.contact.filter import follows_path
from clothsim.physics.contact.search import Pairs

RADIUS_IN_SKINS = 3.0
"""Radius of validity of one list, in skins of the whole surface's list."""


@dataclass(frozen=True)
class CandidateSubset:
    """The candidates of a whole surface that are incident to a `moving` vertex ((N,) booleans).

    pairs holds all of them closer than activation_distance + 2 radius at start (N, 3) [m]: while the moving rows stay
    within `radius` [m] of it, nothing is searched. Beyond it, the whole surface's candidates are used.
    """

    whole: Candidates
    moving: np.ndarray
    rows: Ints
    start: Floats
    radius: float
    pairs: Pairs

    @classmethod
    def restrict(cls, whole: Candidates, moving: np.ndarray, x: Floats) -> Self:
        """The candidates incident to `moving` vertices, listed at x (N, 3) [m]."""
        start_time, radius = perf_counter(), RADIUS_IN_SKINS * whole.skin
        moving_points = np.zeros_like(moving)
        moving_points[whole.surface.first.points] = moving[whole.surface.first.points]
        pairs, _ = whole.search.pairs(x, x, whole.activation_distance + 2.0 * radius, moving_points)
        whole.seconds["candidates"] += perf_counter() - start_time
        return cls(whole, moving, np.flatnonzero(moving), x.copy(), radius, pairs)

    def active(self, x: Floats) -> Pairs:
        """Active pairs at x that can change."""
        if not self._covers(x):
            active = self.whole.active(x)
            return active.subset(
                np.flatnonzero(np.logical_or.reduce([self.moving.take(rows) for rows in active.elements.T]))
            )
        indices, _ = pairs_within(x, self.pairs.elements, self.pairs.n_points, self.whole.activation_distance)
        return self.pairs.subset(indices)

    def step_limit(self, x: Floats, dx: Floats, most: float = 1.0) -> float:
        """Collision-free fraction of dx, which displaces the moving vertices alone, at most `most`."""
        if not (self._covers(x) and self._covers(x + dx)):
            return self.whole.step_limit(x, dx, most)
        return self.whole.collision_free_fraction(self.pairs, x, dx, most)

    def _covers(self, x: Floats) -> bool:
        """True where all moving rows are within `radius` of the start."""
        return follows_path(x, self.start, self.start, self.rows, self.radius)

    def __getattr__(self, name: str) -> Any:
        """All other attributes are those of the whole."""
        return getattr(self.whole, name)
