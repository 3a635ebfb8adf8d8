"""Pairs that could touch: built for a straight path with an inflation, reused until some vertex leaves it."""

from time import perf_counter

import ipctk
import numpy as np

from clothsim.arrays import Floats
from clothsim.contact.surface import ContactSurface

SLACK = 0.9
"""Share of a distance that one step may use up (the conservative rescaling of additive CCD, Li et al. 2021)."""


SEPARATION = 1e-6
"""Share of d_hat below which no step brings a pair. At the size of round-off additive CCD takes millions of steps."""


class Candidates:
    """A cache over one surface; what it returns does not depend on what it holds. It also keeps count of its work.

    d_hat [m]: the pairs needed are those closer; reach [m]: how far a vertex may leave the straight path for which the
    pairs were built before they are built anew.
    """

    def __init__(self, surface: ContactSurface, d_hat: float, reach: float) -> None:
        self.surface = surface
        self.d_hat = d_hat
        self.reach = reach
        self.seconds = {"candidates": 0.0, "CCD": 0.0}
        self.ccd_calls = 0
        self.builds = 0
        self.pairs = 0
        self.forget()

    def forget(self) -> None:
        """Build anew at the next call: a step then depends on its own start only, and a run can be resumed."""
        self._path: tuple[Floats, Floats] | None = None
        self._candidates = ipctk.Candidates()
        self._collisions_at: Floats | None = None
        self._collisions = ipctk.NormalCollisions()

    def collisions(self, x: Floats) -> ipctk.NormalCollisions:
        """The pairs closer than d_hat at x, weighted by area."""
        if self._collisions_at is not None and np.array_equal(x, self._collisions_at):
            return self._collisions
        start = perf_counter()
        self._cover(x, x)
        collisions = ipctk.NormalCollisions()
        collisions.use_area_weighting = True
        collisions.build(self._candidates, self.surface.mesh, self.surface.rows(x), self.d_hat)
        self._collisions, self._collisions_at = collisions, x.copy()
        self.pairs = len(collisions)
        self.seconds["candidates"] += perf_counter() - start
        return collisions

    def minimum_gap(self, x: Floats) -> float:
        """The smallest distance of a pair [m] where it is below d_hat, else inf."""
        collisions = self.collisions(x)
        if not len(collisions):
            return np.inf
        # ipctk returns the squared distance
        return float(np.sqrt(collisions.compute_minimum_distance(self.surface.mesh, self.surface.rows(x))))

    def step_limit(self, x: Floats, dx: Floats) -> float:
        """The fraction of dx that is free of collision, by additive CCD over straight paths, in [0, 1].

        It keeps SEPARATION d_hat, or half the present gap where that is already less.
        """
        separation = min(SEPARATION * self.d_hat, 0.5 * self.minimum_gap(x))
        start = perf_counter()
        self._cover(x, x + dx)
        searched = perf_counter()
        fraction = self._candidates.compute_collision_free_stepsize(
            self.surface.mesh,
            self.surface.rows(x),
            self.surface.rows(x + dx),
            separation,
            ipctk.AdditiveCCD(conservative_rescaling=SLACK),
        )
        self.ccd_calls += 1
        self.seconds["candidates"] += searched - start
        self.seconds["CCD"] += perf_counter() - searched
        return float(fraction)

    def _cover(self, before: Floats, after: Floats) -> None:
        """Hold every pair that can be closer than d_hat while the vertices go straight from `before` to `after`."""
        start, end = before[: self.surface.n_surface], after[: self.surface.n_surface]
        if self._path is not None and all(_strays(points, *self._path) <= self.reach for points in (start, end)):
            return
        self._candidates = ipctk.Candidates()
        # boxes grown by d_hat/2 + reach each meet wherever the distance is below d_hat after both strayed by reach
        grown = 0.5 * self.d_hat + self.reach
        rows, end_rows = np.asfortranarray(start), np.asfortranarray(end)
        self._candidates.build(self.surface.mesh, rows, end_rows, grown, ipctk.LBVH())
        self._path = start.copy(), end.copy()
        self.builds += 1


def _strays(points: Floats, start: Floats, end: Floats) -> float:
    """The largest distance of a point from its segment start -> end [m]."""
    way, reach = end - start, points - start
    length = np.einsum("ij,ij->i", way, way)
    along = np.einsum("ij,ij->i", reach, way) / np.where(length > 0, length, 1.0)
    off = reach - np.clip(along, 0.0, 1.0)[:, None] * way
    return float(np.sqrt(np.einsum("ij,ij->i", off, off).max(initial=0.0)))
