"""Contact candidates: a Verlet list of pairs with a skin, extended to linear paths.

The list belongs to reference positions of all vertices and, since the last search, to a linear path of some of them
that ends there, where the next positions are expected: it holds every pair that is closer than activation_distance +
4 skin on it. For positions no further than m from the reference, or from the point of the path at one common fraction,
it therefore holds every pair closer than activation_distance + 4 skin - 2 m. Beyond that the list is updated: where
most vertices have left the skin, all pairs are searched; where few have (a growing buckle), only the pairs incident to
them. Those are removed from the list, the new path of the vertices is searched against the reference positions of all
others, and the pairs found are merged. So the reference is not a configuration that ever occurred, only one for which
the list is complete.
"""

from dataclasses import dataclass
from time import thread_time
from typing import NamedTuple

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.memo import Memo
from clothsim.physics.contact.barrier_kernels import pairs_within
from clothsim.physics.contact.ccd import TOLERANCE, edge_edge_limit, point_triangle_limit
from clothsim.physics.contact.filter import (
    active_among,
    displacement_norms,
    follows_path,
    pairs_possibly_within,
    path_end,
    path_fraction,
    point_on_path,
    retained_pairs,
)
from clothsim.physics.contact.pair_list import NO_PAIRS, Pairs, merged
from clothsim.physics.contact.search import CandidateSearch
from clothsim.physics.contact.surface import ContactSurface

MAX_FRACTION_OUTSIDE = 0.25
"""Fraction of the vertices outside the skin up to which only theirs are searched: two such searches cost one of all."""

PATH_TOLERANCE = 1e-3
"""Fraction of the skin within which positions lie on a path: x + t dx is rounded."""


class Displacement(NamedTuple):
    """Displacement of each row of x from the reference (N,) [m], and by how much a pair may approach by it [m].

    A pair has one side in each group: beside bodies that stand still by what the cloth moves, not by twice that.
    """

    by_row: Floats
    approach: float


SLACK = 0.9
"""Fraction of a distance that one step may use up (the conservative rescaling of additive CCD, Li et al. 2021)."""


@dataclass
class ActivePairs:
    """The pairs that are active at one position, and their smallest gap [m] once it was asked for."""

    pairs: Pairs
    gap: float | None = None


class Candidates:
    """Cache of contact candidates of one surface; the results do not depend on its content.

    Parameters
    ----------
    surface : ContactSurface
        The primitives that may touch.
    activation_distance : float
        offset + d_hat: the active set holds the pairs closer than this [m].
    skin : float
        The list holds pairs closer than activation_distance + 4 skin; a vertex further than the skin from its reference
        position may be searched again [m].
    offset : float
        Distance that no pair goes below [m].
    """

    def __init__(self, surface: ContactSurface, activation_distance: float, skin: float, offset: float = 0.0) -> None:
        self.surface = surface
        self.activation_distance = activation_distance
        self.skin = skin
        self.offset = offset
        self.seconds = {"candidates": 0.0, "CCD": 0.0}
        self.ccd_calls = 0
        self.builds = 0
        self.searched_vertices = 0
        self.pairs = 0
        self.search = CandidateSearch(surface)
        self.clear()

    @property
    def d_hat(self) -> float:
        """Range of the barrier beyond the offset [m]."""
        return self.activation_distance - self.offset

    def clear(self) -> None:
        """Search again at the next call."""
        self._path: tuple[Floats, Floats] | None = None
        self._pairs = NO_PAIRS
        self._distances = np.zeros(0)
        self._active = Memo[ActivePairs]()

    def active(self, x: Floats) -> Pairs:
        """Active set at x: the pairs closer than the activation distance."""
        return self._active_pairs(x).pairs

    def read(self, x: Floats) -> Floats:
        """The rows of x that hold all that may touch: a view."""
        return self.surface.read(x)

    def _active_pairs(self, x: Floats) -> ActivePairs:
        """Active set at x, counted; cached for the last positions, as both ends of a step are asked for in turns."""
        found = self._active.at(self.read(x), self._find_active)
        self.pairs = len(found.pairs)
        return found

    def _find_active(self, x: Floats) -> ActivePairs:
        start = thread_time()
        pairs = self.within(x, self.activation_distance)
        self.seconds["candidates"] += thread_time() - start
        return ActivePairs(pairs)

    def within(self, x: Floats, distance: float) -> Pairs:
        """Pairs closer than `distance` [m] at x, at most activation_distance + skin."""
        x = self.read(x)
        displacement = self._ensure_covers(x, x, distance)
        pairs = self._pairs
        if not len(pairs):
            return pairs
        listed = pairs.elements, pairs.n_points, self._distances, displacement.by_row, displacement.approach
        return pairs.subset(active_among(x, *listed, distance))

    def minimum_gap(self, x: Floats) -> float:
        """Smallest distance of an active pair less the offset [m]; inf where no pair is active."""
        active = self._active_pairs(x)
        if active.gap is None:
            _, distances_squared = pairs_within(x, active.pairs.elements, active.pairs.n_points, np.inf)
            active.gap = float(np.sqrt(distances_squared.min(initial=np.inf))) - self.offset
        return active.gap

    def gap_change(self, x: Floats, dx: Floats, within: float = np.inf) -> float:
        """Largest |g(x + dx) - g(x)| / g(x) of the pairs active before or after; g: the distance less the offset.

        Pairs with g(x) >= `within` [m] do not count.
        """
        x, dx = self.read(x), self.read(dx)
        change, end = 0.0, x + dx
        for positions in (end, x):
            active = self.active(positions)
            if not len(active):
                continue
            before, after = (np.sqrt(pairs_within(at, active.elements, active.n_points, np.inf)[1]) for at in (x, end))
            gap = before - self.offset
            change = max(change, float((np.abs(after - before) / gap)[gap < within].max(initial=0.0)))
        return change

    def closest_pair(self, x: Floats) -> Ints:
        """Rows (4,) of the closest active pair; empty where there is none."""
        active = self.active(x)
        if not len(active):
            return np.zeros(0, np.int64)
        _, distances_squared = pairs_within(x, active.elements, active.n_points, np.inf)
        return active.elements[int(distances_squared.argmin())]

    def step_limit(self, x: Floats, dx: Floats, most: float = 1.0) -> float:
        """Collision-free fraction of dx, at most `most`, by additive CCD over linear paths.

        The listed pairs bound the path that is searched for the others. 0 where x + dx is not finite.
        """
        start, ccd_seconds = thread_time(), self.seconds["CCD"]
        x, dx = self.read(x), self.read(dx)
        listed, displacement, requested = self._pairs, None, most
        after, finite = path_end(x, dx, most)
        if not finite:
            return 0.0
        if self._path is not None:
            displacement = self._displacements(x, after)
            most = self._limit_of_listed(displacement, x, dx, most)
        if most < requested:
            displacement, after = None, path_end(x, dx, most)[0]
        displacement = self._ensure_covers(x, after, self.activation_distance, displacement)
        if self._pairs is not listed:
            most = self._limit_of_listed(displacement, x, dx, most)
        self.seconds["candidates"] += thread_time() - start - (self.seconds["CCD"] - ccd_seconds)
        return most

    def _limit_of_listed(self, displacement: Displacement, x: Floats, dx: Floats, most: float) -> float:
        """Collision-free fraction over the listed pairs."""
        if not len(self._pairs):
            return most
        # With d its distance at the reference, a pair is at most d + displacement apart at the start of the path. It
        # may descend to its floor or TOLERANCE above, where the CCD stops it, if
        # d - displacement <= offset + remainder (d + displacement - offset).
        remainder = 1.0 - SLACK * (1.0 - 2.0 * TOLERANCE)
        factor, pairs = (1.0 + remainder) / (1.0 - remainder), self._pairs
        listed = pairs.elements, pairs.n_points, self._distances, displacement.by_row, displacement.approach
        indices = pairs_possibly_within(*listed, self.offset, factor)
        n_points = int(np.searchsorted(indices, self._pairs.n_points))
        return self.collision_free_fraction(self._pairs.elements.take(indices, axis=0), n_points, x, dx, most)

    def collision_free_fraction(self, elements: Ints, n_points: int, x: Floats, dx: Floats, most: float = 1.0) -> float:
        """Fraction of dx, at most `most`, on which no pair collides; the first n_points are point-triangle pairs."""
        start = thread_time()
        points, edges = elements[:n_points], elements[n_points:]
        ccd_settings = self.offset, SLACK, self.d_hat
        fraction = point_triangle_limit(x, dx, points, *ccd_settings, most)
        fraction = edge_edge_limit(x, dx, edges, *ccd_settings, fraction)
        self.ccd_calls += 1
        self.seconds["CCD"] += thread_time() - start
        return float(fraction)

    def _ensure_covers(
        self, before: Floats, after: Floats, distance: float, displacement: Displacement | None = None
    ) -> Displacement:
        """Update the list unless it holds all pairs closer than `distance` <= activation_distance + skin on a path.

        Returns the displacement from the reference; displacement: the same for the present reference.
        """
        margin = 0.5 * (self.activation_distance + 4.0 * self.skin - distance)
        if self._path is not None:
            displacement = self._displacements(before, after) if displacement is None else displacement
            ends = (before,) if after is before else (after, before)
            if displacement.approach <= 2.0 * margin or all(
                follows_path(x, *self._path, self.surface.rows, margin) for x in ends
            ):
                return displacement
        self._update_list(before, after)
        return self._displacements(before, after)

    def _displacements(self, before: Floats, after: Floats) -> Displacement:
        """Largest distance of each row of x from the reference on a path."""
        assert self._path is not None
        rows, n_first = self.surface.rows, self.surface.n_first
        by_row, first, second = displacement_norms(before, after, self._path[0], rows, n_first)
        return Displacement(by_row, first + (second if n_first < len(rows) else first))

    def _update_list(self, before: Floats, after: Floats) -> None:
        """Search the pairs incident to rows that leave the skin on a path, or all pairs; the rest is cached."""
        self.builds += 1
        distance = self.activation_distance + (4.0 + 2.0 * PATH_TOLERANCE) * self.skin
        moved = np.zeros(len(before), bool)
        if self._path is not None:  # the reference moves along its path to the point closest to `before`
            fraction = path_fraction(before, *self._path, self.surface.rows)
            positions, moved = point_on_path(*self._path, fraction)
            self._path = positions, positions
        every, outside = self._path is None, np.zeros(len(before), bool)
        if not every:
            outside = ~(self._displacements(before, after).by_row <= self.skin)
            few = outside.sum() <= MAX_FRACTION_OUTSIDE * len(self.surface.first.points)
            still = self.surface.is_self_contact or not outside[self.surface.second.points].any()
            every = not few or not still
        if every:
            self._path = after.copy(), before.copy()
            self._pairs, self._distances = self.search.pairs(*self._path, distance)
            self.searched_vertices += len(self.surface.rows)
            return
        assert self._path is not None
        self.searched_vertices += int(outside.sum())
        indices, distances = retained_pairs(
            self._path[0], self._pairs.elements, self._pairs.n_points, self._distances, moved, outside, distance
        )
        start = np.where(outside[:, None], after, self._path[0])
        self._path = start, np.where(outside[:, None], before, start)
        found, found_distances = self.search.pairs(*self._path, distance, outside)
        self._pairs, self._distances = merged(self._pairs, indices, distances, found, found_distances)
