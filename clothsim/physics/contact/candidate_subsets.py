"""Subsets of contact candidates: pairs of moving vertices alone, and all but excluded ones."""

from dataclasses import dataclass
from time import thread_time
from typing import Any, Self

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.physics.contact.barrier_kernels import pairs_within
from clothsim.physics.contact.candidates import Candidates
from clothsim.physics.contact.filter import follows_path
from clothsim.physics.contact.pair_list import Pairs
from clothsim.physics.contact.search import CandidateSearch

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
        start_time, radius = thread_time(), RADIUS_IN_SKINS * whole.skin
        moving_points = np.zeros_like(moving)
        moving_points[whole.surface.first.points] = moving[whole.surface.first.points]
        pairs, _ = whole.search.pairs(x, x, whole.activation_distance + 2.0 * radius, moving_points)
        whole.seconds["candidates"] += thread_time() - start_time
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
        return self.whole.collision_free_fraction(self.pairs.elements, self.pairs.n_points, x, dx, most)

    def _covers(self, x: Floats) -> bool:
        """True where all moving rows are within `radius` of the start."""
        return follows_path(x, self.start, self.start, self.rows, self.radius)

    def __getattr__(self, name: str) -> Any:
        """All other attributes are those of the whole."""
        return getattr(self.whole, name)


@dataclass(frozen=True)
class ExclusionMask:
    """Contact exclusion mask: pairs of primitives left out, those of vertices that a body carries through a pinch.

    A cloth primitive (point, edge, triangle) all of whose vertices are flypapered has no pair with a body and none with
    another such primitive: neither moves freely. One with flypapered and free vertices keeps its pairs with the
    vertices of the body that `own` lists for each flypapered one of them.

    Parameters
    ----------
    flypapered : (N,) bool array
        Flypapered rows of x.
    own : (k,) int array
        Sorted keys v N + q: q is a body row of the part that carries the row v.
    layers : bool
        Exclude also the pairs of two cloth primitives each of which has a flypapered vertex: layers that would block
        one another at the border of a pinch.
    """

    flypapered: np.ndarray
    own: Ints
    layers: bool = False

    def mask(self, elements: Ints, n_points: int, is_self: bool) -> np.ndarray:
        """Mask of the excluded pairs (p,) among `elements` (p, 4), the first n_points of a point and a triangle."""
        flypapered = self.flypapered[elements]
        if is_self and not self.layers:
            return np.asarray(flypapered.all(axis=1))
        if is_self:
            first = np.arange(4) < np.where(np.arange(len(elements)) < n_points, 1, 2)[:, None]
            return np.asarray((flypapered & first).any(axis=1) & (flypapered & ~first).any(axis=1))
        excluded = np.zeros(len(elements), bool)
        some = np.flatnonzero(flypapered.any(axis=1))
        rows, held = elements[some], flypapered[some]
        size = np.where(some < n_points, 1, 2)
        on_cloth = np.where(np.arange(4) < size[:, None], 0, 1) == np.where(held.argmax(axis=1) < size, 0, 1)[:, None]
        result = (held | ~on_cloth).all(axis=1)
        for k in range(4):
            for q in range(4):
                keys = rows[:, k] * len(self.flypapered) + rows[:, q]
                result |= held[:, k] & ~on_cloth[:, q] & ~_contains(self.own, keys)
        excluded[some] = result
        return excluded


@dataclass(frozen=True)
class _MaskedSearch:
    """A search that leaves out excluded pairs."""

    whole: CandidateSearch
    exclusion: ExclusionMask

    def pairs(
        self, before: Floats, after: Floats, distance: float, only: np.ndarray | None = None
    ) -> tuple[Pairs, Floats]:
        """As `CandidateSearch.pairs`."""
        pairs, distances = self.whole.pairs(before, after, distance, only)
        is_self = self.whole.surface.is_self_contact
        left = np.flatnonzero(~self.exclusion.mask(pairs.elements, pairs.n_points, is_self))
        return pairs.subset(left), distances[left]


class MaskedCandidates(Candidates):
    """The candidates of a whole surface without excluded pairs; trees and timers are those of the whole."""

    def __init__(self, whole: Candidates, exclusion: ExclusionMask) -> None:
        self.__dict__.update(whole.__dict__)
        self.search = _MaskedSearch(whole.search, exclusion)  # type: ignore[assignment]
        self.clear()

    def count_for(self, whole: Candidates) -> None:
        """Give the counters back to the whole."""
        for name in ("ccd_calls", "builds", "searched_vertices", "pairs"):
            setattr(whole, name, getattr(self, name))


def _contains(keys: Ints, wanted: Ints) -> np.ndarray:
    """Mask of the `wanted` that are among the sorted `keys`: `np.isin` would sort them again."""
    if not len(keys):
        return np.zeros(len(wanted), bool)
    return np.asarray(keys[np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)] == wanted)
