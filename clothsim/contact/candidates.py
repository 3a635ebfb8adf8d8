"""Pairs that could touch: found for a straight way with a margin, and held until some vertex leaves it.

The list is that of a base, a place of all vertices, from which some, since the last search, may go a way: it holds
every pair that is closer than limit + 4 reach on it. Of a place that is no further than m from the base, or from one
and the same share of the way, it so holds every pair that is closer than limit + 4 reach - 2 m. What lies further off
is searched for: where most vertices do, all pairs anew; where few do (a buckle that grows), only what hangs on them.
They are taken out of the list, their new way is searched against all others where the base has them, and what is found
is put in. So the base is no place that was ever taken, but one of which the list is complete.
"""

from time import perf_counter

import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.contact.barrier_kernels import near_pairs
from clothsim.contact.ccd import CLOSE, edge_edge_limit, point_triangle_limit
from clothsim.contact.filter import (
    displaced,
    keeps_to,
    may_be_near,
    near_among,
    place_on_way,
    share_of_way,
    still_near,
)
from clothsim.contact.pair_list import NONE, Pairs, together
from clothsim.contact.search import Search
from clothsim.contact.surface import ContactSurface
from clothsim.indexing import equal

FEW = 0.25
"""Share of the vertices that may have left the base for a search of theirs alone: two such cost as one of all."""

AWAY = 1e-3
"""Share of `reach` within which a place lies on a way: x + t dx is rounded."""

SLACK = 0.9
"""Share of a distance that one step may use up (the conservative rescaling of additive CCD, Li et al. 2021)."""


class Candidates:
    """A cache over one surface; what it returns does not depend on what it holds. It also keeps count of its work.

    limit [m]: the pairs needed are those closer (d_hat and offset); reach [m]: a list is of pairs closer than limit + 4
    reach, and a vertex that goes further than it from the base may be searched for anew; offset [m]: the distance that
    no pair goes below.
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
        self.search = Search(surface)
        self.clear()

    def clear(self) -> None:
        """Search anew at the next call."""
        self._way: tuple[Floats, Floats] | None = None
        self._pairs = NONE
        self._distances = np.zeros(0)
        self._near_at: Floats | None = None
        self._near = NONE
        self._gap: float | None = None

    def active(self, x: Floats) -> Pairs:
        """The pairs closer than `limit` at x."""
        if self._near_at is not None and equal(x, self._near_at):
            return self._near
        start = perf_counter()
        self._near, self._near_at, self._gap = self.within(x, self.limit), x.copy(), None
        self.pairs = len(self._near)
        self.seconds["candidates"] += perf_counter() - start
        return self._near

    def within(self, x: Floats, distance: float) -> Pairs:
        """The pairs that are closer than `distance` [m] at x, at most limit + reach."""
        gone = self._hold(x, x, distance)
        pairs = self._pairs
        return pairs.at(near_among(x, pairs.elements, pairs.n_points, self._distances, gone, distance))

    def minimum_gap(self, x: Floats) -> float:
        """The smallest distance of a pair less the offset [m] where it is below d_hat, else inf."""
        near = self.active(x)
        if self._gap is None:
            _, squared = near_pairs(x, near.elements, near.n_points, np.inf)
            self._gap = float(np.sqrt(squared.min(initial=np.inf))) - self.offset
        return self._gap

    def gap_change(self, x: Floats, dx: Floats) -> float:
        """The largest |g(x + dx) - g(x)| / g(x) of the pairs near before or after; g: the distance less the offset."""
        change = 0.0
        for place in (x + dx, x):
            near = self.active(place)
            before, after = (np.sqrt(near_pairs(at, near.elements, near.n_points, np.inf)[1]) for at in (x, x + dx))
            change = max(change, float((np.abs(after - before) / (before - self.offset)).max(initial=0.0)))
        return change

    def closest_pair(self, x: Floats) -> Ints:
        """The rows (4,) of the closest pair below `limit`; empty where there is none."""
        near = self.active(x)
        if not len(near):
            return np.zeros(0, np.int64)
        _, squared = near_pairs(x, near.elements, near.n_points, np.inf)
        return near.elements[int(squared.argmin())]

    def step_limit(self, x: Floats, dx: Floats, most: float = 1.0) -> float:
        """The fraction of dx, at most `most`, that is free of collision, by additive CCD over straight paths.

        What is in the list tells how far the search for the rest has to look. 0 where a place is no number.
        """
        start, of_ccd = perf_counter(), self.seconds["CCD"]
        known, gone, after, whole = self._pairs, None, x + most * dx, most
        if not np.isfinite(after).all():
            return 0.0
        if self._way is not None:
            gone = self._gone(x, after)
            most = self._free_of_known(gone, x, dx, most)
        if most < whole:
            gone, after = None, x + most * dx
        gone = self._hold(x, after, self.limit, gone)
        if self._pairs is not known:
            most = self._free_of_known(gone, x, dx, most)
        self.seconds["candidates"] += perf_counter() - start - (self.seconds["CCD"] - of_ccd)
        return most

    def _free_of_known(self, gone: Floats, x: Floats, dx: Floats, most: float) -> float:
        return self.free(self._pairs.at(self._may_reach_their_floor(gone)), x, dx, most)

    def free(self, pairs: Pairs, x: Floats, dx: Floats, most: float = 1.0) -> float:
        """The fraction of dx, at most `most`, on which none of these pairs collides."""
        start = perf_counter()
        points, edges = pairs.elements[: pairs.n_points], pairs.elements[pairs.n_points :]
        keep = self.offset, SLACK, self.limit - self.offset
        fraction = point_triangle_limit(x, dx, points, *keep, most)
        fraction = edge_edge_limit(x, dx, edges, *keep, fraction)
        self.ccd_calls += 1
        self.seconds["CCD"] += perf_counter() - start
        return float(fraction)

    def _may_reach_their_floor(self, gone: Floats) -> Ints:
        """The numbers of the pairs that the CCD may stop, if no row of x goes further from the base than `gone`.

        Such a pair is d + gone away at most when the way begins, d in the base, and comes down to its floor or CLOSE
        above: d - gone <= offset + left (d + gone - offset).
        """
        left = 1.0 - SLACK * (1.0 - 2.0 * CLOSE)
        factor = (1.0 + left) / (1.0 - left)
        pairs = self._pairs
        return may_be_near(pairs.elements, pairs.n_points, self._distances, gone, self.offset, factor)

    def _hold(self, before: Floats, after: Floats, distance: float, gone: Floats | None = None) -> Floats:
        """Let the list hold every pair that comes closer than `distance` <= limit + reach [m] on a way.

        Returns how far each row of x then goes from the base (N,) [m]; gone: the same for the base as it is.
        """
        room = 0.5 * (self.limit + 4.0 * self.reach - distance)
        if self._way is not None:
            gone = self._gone(before, after) if gone is None else gone
            if gone.max(initial=0.0) <= room or self._keeps_to_way(before, after, room):
                return gone
        self._search_way(before, after)
        return self._gone(before, after)

    def _gone(self, before: Floats, after: Floats) -> Floats:
        assert self._way is not None
        return displaced(before, after, self._way[0], self.surface.rows)

    def _keeps_to_way(self, before: Floats, after: Floats, room: float) -> bool:
        """Whether no row is further than `room` [m] from the way that the list is of, gone by all at one pace."""
        assert self._way is not None
        places = (before,) if after is before else (after, before)
        return all(keeps_to(x, *self._way, self.surface.rows, room) for x in places)

    def _search_way(self, before: Floats, after: Floats) -> None:
        """The list of a way: what hangs on rows of x that leave the base is searched for, the rest is known."""
        self.builds += 1
        distance = self.limit + (4.0 + 2.0 * AWAY) * self.reach
        settled = self._settle(before)
        left = self._left(before, after)
        if left is None:
            self._way = before.copy(), after.copy()
            self._pairs, self._distances = self.search.pairs(*self._way, distance)
            self.searched += len(self.surface.rows)
            return
        assert self._way is not None
        self.searched += int(left.sum())
        numbers, distances = still_near(
            self._way[0], self._pairs.elements, self._pairs.n_points, self._distances, settled, left, distance
        )
        start = np.where(left[:, None], before, self._way[0])
        self._way = start, np.where(left[:, None], after, start)
        found, far = self.search.pairs(*self._way, distance, left)
        self._pairs, self._distances = together(self._pairs, numbers, distances, found, far)

    def _settle(self, x: Floats) -> np.ndarray:
        """Move the base along the way to where it is closest to x: the list holds there. Which rows moved (N,)."""
        if self._way is None:
            return np.zeros(len(x), bool)
        place, moved = place_on_way(*self._way, share_of_way(x, *self._way, self.surface.rows))
        self._way = place, place
        return moved

    def _left(self, before: Floats, after: Floats) -> np.ndarray | None:
        """Which rows of x leave the base on a way, (N,); None where all are to be searched."""
        if self._way is None:
            return None
        left = ~(self._gone(before, after) <= self.reach)
        few = left.sum() <= FEW * len(self.surface.first.points)
        return left if few and (self.surface.itself or not left[self.surface.second.points].any()) else None
