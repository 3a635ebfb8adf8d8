"""Pairs that could touch: found for a straight way with a margin, and reused until some vertex leaves it.

Two lists. The base: the pairs that were near at one place. While no vertex is further than m <= `reach` from there, a
pair nearer than `limit` was nearer than limit + 2 m: sorted by distance, the first few are all that is looked at. The
candidates: those of a Newton step, which may be long. Where most vertices go far, all are searched, and the base is
taken anew from what is found. Where few do (a buckle that grows), only what hangs on them is searched: the others'
pairs are in the base.
"""

from time import perf_counter

import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.compiled import kernel
from clothsim.contact.barrier_kernels import near_pairs
from clothsim.contact.ccd import edge_edge_limit, point_triangle_limit
from clothsim.contact.search import NONE, Pairs, Search, together
from clothsim.contact.surface import ContactSurface

FEW = 0.25
"""Share of the vertices that may have left the base for a search of theirs alone: two such cost as one of all."""

AWAY = 1e-3
"""Share of `reach` within which a place lies on a way: x + t dx is rounded."""

SLACK = 0.9
"""Share of a distance that one step may use up (the conservative rescaling of additive CCD, Li et al. 2021)."""


class Candidates:
    """A cache over one surface; what it returns does not depend on what it holds. It also keeps count of its work.

    limit [m]: the pairs needed are those closer (d_hat and offset); reach [m]: how far a vertex may go from where a
    list was built before it is built anew; offset [m]: the distance that no pair goes below.
    """

    def __init__(self, surface: ContactSurface, limit: float, reach: float, offset: float = 0.0) -> None:
        self.surface = surface
        self.limit = limit
        self.reach = reach
        self.offset = offset
        self.seconds = {"candidates": 0.0, "CCD": 0.0}
        self.ccd_calls = 0
        self.builds = 0
        self.searched = 0
        self.pairs = 0
        self._search = Search(surface)
        self.forget()

    def forget(self) -> None:
        """Search anew at the next call: a step then depends on its own start only, and a run can be resumed."""
        self._path: tuple[Floats, Floats] | None = None
        self._candidates = NONE
        self._complete = False
        self._base_at: Floats | None = None
        self._base = NONE
        self._order = np.zeros(0, np.int64)
        self._distances = np.zeros(0)
        self._near_at: Floats | None = None
        self._near = NONE
        self._gap = np.inf

    def near(self, x: Floats) -> Pairs:
        """The pairs closer than `limit` at x."""
        if self._near_at is not None and np.array_equal(x, self._near_at):
            return self._near
        start = perf_counter()
        some = self._some(x, self.limit, self.reach)
        numbers, squared = near_pairs(x, some.elements, some.n_points, self.limit)
        self._near, self._near_at = some.at(numbers), x.copy()
        self._gap = float(np.sqrt(squared.min())) - self.offset if len(squared) else np.inf
        self.pairs = len(numbers)
        self.seconds["candidates"] += perf_counter() - start
        return self._near

    def within(self, x: Floats, distance: float) -> Pairs:
        """The pairs that are closer than `distance` [m] at x, at most limit + reach."""
        some = self._some(x, distance, 0.5 * self.reach)
        numbers, _ = near_pairs(x, some.elements, some.n_points, distance)
        return some.at(numbers)

    def minimum_gap(self, x: Floats) -> float:
        """The smallest distance of a pair less the offset [m] where it is below d_hat, else inf."""
        self.near(x)
        return self._gap

    def gap_change(self, x: Floats, dx: Floats) -> float:
        """The largest |g(x + dx) - g(x)| / g(x) of the pairs near before or after; g: the distance less the offset."""
        change = 0.0
        for place in (x + dx, x):
            near = self.near(place)
            before, after = (np.sqrt(near_pairs(at, near.elements, near.n_points, np.inf)[1]) for at in (x, x + dx))
            change = max(change, float((np.abs(after - before) / (before - self.offset)).max(initial=0.0)))
        return change

    def closest_pair(self, x: Floats) -> Ints:
        """The rows (4,) of the closest pair below `limit`; empty where there is none."""
        near = self.near(x)
        if not len(near):
            return np.zeros(0, np.int64)
        _, squared = near_pairs(x, near.elements, near.n_points, np.inf)
        return near.elements[int(squared.argmin())]

    def step_limit(self, x: Floats, dx: Floats) -> float:
        """The fraction of dx that is free of collision, by additive CCD over straight paths, in [0, 1]."""
        start = perf_counter()
        after = x + dx
        moved = float(np.maximum(self._moved(x), self._moved(after)))
        if moved <= self.reach:  # x has moved, too: who may reach its floor was nearer than offset + 2 moved 1.1 / .9
            pairs = self._sorted_out(moved * (2.0 - SLACK) / SLACK, self.offset)
        else:
            pairs = self._cover(x, after, self.reach)
        searched = perf_counter()
        points, edges = pairs.elements[: pairs.n_points], pairs.elements[pairs.n_points :]
        keep = self.offset, SLACK, self.limit - self.offset
        fraction = point_triangle_limit(x, dx, points, *keep, 1.0)
        fraction = edge_edge_limit(x, dx, edges, *keep, fraction)
        self.ccd_calls += 1
        self.seconds["candidates"] += searched - start
        self.seconds["CCD"] += perf_counter() - searched
        return float(fraction)

    def _moved(self, x: Floats) -> float:
        """The farthest that a vertex is from where the base was taken [m]."""
        return (
            np.inf if self._base_at is None else float(_displaced(x, self._base_at, self.surface.rows).max(initial=0))
        )

    def _some(self, x: Floats, distance: float, reach: float) -> Pairs:
        """Some pairs, among them all nearer than `distance` <= limit + 2 (self.reach - reach) at x."""
        moved = self._moved(x)
        return self._sorted_out(moved, distance) if moved <= self.reach else self._cover(x, x, reach)

    def _sorted_out(self, moved: float, distance: float) -> Pairs:
        """The pairs of the base that may be nearer than `distance` where no vertex has moved further than `moved`."""
        count = int(np.searchsorted(self._distances, distance + 2.0 * moved, side="right"))
        return self._base.at(np.sort(self._order[:count]))

    def _cover(self, before: Floats, after: Floats, reach: float) -> Pairs:
        """Every pair that comes closer than limit + 2 (self.reach - reach) on a way, by the last search if near its."""
        start, end = before[self.surface.rows], after[self.surface.rows]
        if self._path is None or not all(strays(points, *self._path) <= reach for points in (start, end)):
            self._candidates = self._search_way(before, after)
            self._path = start, end
            self.builds += 1
        return self._candidates

    def _search_way(self, before: Floats, after: Floats) -> Pairs:
        """Every pair that comes closer than limit + 2 reach on this way.

        Pairs of the base were up to limit + 4 reach apart: what has gone no further than reach is closer than
        limit + 2 reach only if it is among them. Where all are searched, the list holds what comes closer than
        limit + 4 reach, so that the place to which Newton then goes on this way can be the next base.
        """
        distance = self.limit + (4.0 + 2.0 * AWAY) * self.reach
        way = self._path if self._complete else None
        if way is not None and strays(before[self.surface.rows], *way) <= AWAY * self.reach:
            self._found_at(before, self._candidates)
        left = self._left(before, after)
        self._complete = left is None
        if left is None:
            pairs = self._search.pairs(before, after, distance)
            self.searched += len(self.surface.rows)
            self._found_at(before, pairs)
            return pairs
        kept = np.flatnonzero(~left[self._base.elements].any(axis=1))
        self.searched += int(left.sum())
        return together(self._base.at(kept), self._search.pairs(before, after, distance, left))

    def _found_at(self, x: Floats, pairs: Pairs) -> None:
        """x is the new base: those of the pairs, which are all that may count, that are near there."""
        numbers, squared = near_pairs(x, pairs.elements, pairs.n_points, self.limit + 4.0 * self.reach)
        self._base, self._base_at = pairs.at(numbers), x.copy()
        self._order = np.argsort(squared, kind="stable")
        self._distances = np.sqrt(squared[self._order])

    def _left(self, before: Floats, after: Floats) -> np.ndarray | None:
        """Which rows of x leave the base on a way, (N,); None where all are to be searched."""
        rows, second = self.surface.rows, self.surface.second.points
        if self._base_at is None:
            return None
        gone = ~(np.maximum(*(_displaced(x, self._base_at, rows) for x in (before, after))) <= self.reach)
        left = np.zeros(len(before), bool)
        left[rows] = gone
        if gone.sum() > FEW * len(self.surface.first.points) or (not self.surface.itself and left[second].any()):
            return None
        return left


@kernel
def _displaced(x: Floats, at: Floats, rows: Ints) -> Floats:
    """How far each of these rows of x is from where it was [m]."""
    displaced = np.empty(len(rows))
    for k in range(len(rows)):
        squared = 0.0
        for axis in range(3):
            squared += (x[rows[k], axis] - at[rows[k], axis]) ** 2
        displaced[k] = np.sqrt(squared)
    return displaced


def strays(points: Floats, start: Floats, end: Floats) -> float:
    """The largest distance [m] of a point from where it is when all have gone one and the same share start -> end."""
    return float(_strays(points, start, end))


@kernel
def _strays(points, start, end):
    length = along = 0.0
    for i in range(len(points)):
        for k in range(3):
            length += (end[i, k] - start[i, k]) ** 2
            along += (points[i, k] - start[i, k]) * (end[i, k] - start[i, k])
    share = min(max(along / length, 0.0), 1.0) if length > 0.0 else 0.0
    most = 0.0
    for i in range(len(points)):
        off = 0.0
        for k in range(3):
            off += (points[i, k] - start[i, k] - share * (end[i, k] - start[i, k])) ** 2
        if not off <= most:  # NaN, too, is far away
            most = off
    return np.sqrt(most)
