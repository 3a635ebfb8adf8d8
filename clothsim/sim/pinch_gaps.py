"""Gaps between opposing body surfaces about cloth vertices, at the start and at the end of a step.

A vertex is in a pinch where the gap along the normal of the closest body triangle closes below a limit, or where the
surfaces cross one another.
"""

from dataclasses import dataclass, fields
from typing import Self

import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.contact.opposing import INSIDE, closest_on_triangles, line_hits, sides
from clothsim.contact.search import Search
from clothsim.mesh.world import World
from clothsim.sim.carried import Carried, normals

LEAST = 1e-2
"""Fraction of the limit below which a hit is of the same surface, at a fold."""
CLOSING = 1e-6
"""Fraction of the limit by which a gap must close in a step: a body at rest or moving rigidly pinches nothing."""


@dataclass(frozen=True)
class Sides:
    """Vertices in a pinch, with the closest triangle (`near`) and the opposing one (`far`) of each.

    vertices (k,); near, far (k, 3): rows of x; near_weights, far_weights (k, 3): weights of their corners; gaps (k,):
    at the end of the step [m], negative where the surfaces have crossed.
    """

    vertices: Ints
    near: Ints
    near_weights: Floats
    far: Ints
    far_weights: Floats
    gaps: Floats

    def without(self, rows: Ints) -> Self:
        """Those but for some rows of x."""
        chosen = ~np.isin(self.vertices, rows)
        return type(self)(*(getattr(self, each.name)[chosen] for each in fields(self)))


@dataclass(frozen=True)
class Neighbours:
    """Body triangles (p, 3) within a distance of cloth vertices (p,), by vertex; weights (p, 3): of closest points."""

    vertices: Ints
    triangles: Ints
    weights: Floats
    distances: Floats

    def closest(self) -> Ints:
        """Index of the closest triangle of each vertex."""
        order = np.lexsort((self.distances, self.vertices))
        _, first = np.unique(self.vertices[order], return_index=True)
        return np.asarray(order[first])


def neighbours(search: Search, world: World, x: Floats, reach: float) -> Neighbours:
    """Find the body triangles within `reach` [m] of each cloth vertex at x (N, 3) [m]."""
    pairs, _ = search.pairs(x, x, reach)
    rows = pairs.elements[: pairs.n_points]
    rows = rows[rows[:, 0] < world.n_cloth]
    weights, distances = closest_on_triangles(x, rows[:, 0].copy(), rows[:, 1:].copy())
    return Neighbours(rows[:, 0], rows[:, 1:], weights, distances)


def pinched(near: Neighbours, start: Floats, end: Floats, limit: float) -> Sides:
    """Find the vertices about which a gap closes below `limit` [m] between start and end (N, 3) [m]."""
    closest = near.closest()
    which = np.searchsorted(near.vertices[closest], near.vertices)
    own = closest[which]
    hits = _opposing_hits(near.triangles[own], near.weights[own], near.triangles, start, end)
    first_gap, last_gap, weights = hits
    between = _lies_between(near, own, start, first_gap, limit)
    closes = (last_gap < limit) & (last_gap < first_gap - CLOSING * limit) & (first_gap > LEAST * limit) & between
    rows = np.flatnonzero(closes)
    rows = rows[np.lexsort((last_gap[rows], near.vertices[rows]))]
    vertices, first = np.unique(near.vertices[rows], return_index=True)
    chosen = rows[first]
    mine = own[chosen]
    return Sides(
        vertices, near.triangles[mine], near.weights[mine], near.triangles[chosen], weights[chosen], last_gap[chosen]
    )


def _opposing_hits(
    own: Ints, weights: Floats, others: Ints, start: Floats, end: Floats
) -> tuple[Floats, Floats, Floats]:
    """Gaps at the start and at the end (p,) [m], nan where nothing opposes, and the weights of the opposing points."""
    points = [np.einsum("kc,kcd->kd", weights, x[own]) for x in (start, end)]
    along = [normals(x, own) for x in (start, end)]
    gaps, far = line_hits(end, points[1], along[1], np.ascontiguousarray(others))
    opposes = np.einsum("kd,kd->k", normals(end, others), along[1]) < 0.0
    gaps = np.where(opposes, gaps, np.nan)
    there = np.einsum("kc,kcd->kd", far, start[others])
    return np.einsum("kd,kd->k", there - points[0], along[0]), gaps, far


def _lies_between(near: Neighbours, own: Ints, start: Floats, gaps: Floats, limit: float) -> np.ndarray:
    """Mask (p,) of vertices between the closest point and the opposing one, not beside them."""
    triangles = near.triangles[own]
    along = normals(start, triangles)
    offset = start[near.vertices] - np.einsum("kc,kcd->kd", near.weights[own], start[triangles])
    height = np.einsum("kd,kd->k", offset, along)
    lateral = np.linalg.norm(offset - height[:, None] * along, axis=1)
    return np.asarray((lateral <= limit) & (height < gaps))


def gaps_of(carried: Carried, near: Neighbours, world: World, x: Floats, limit: float) -> Floats:
    """Gaps in front of the triangles that carry vertices, at x (N, 3), (k,) [m].

    -inf where the parts have crossed, or the triangle is inside another part of the bodies; inf where nothing is in
    front of it within the distance of `near`.
    """
    place = np.full(len(x), -1)
    place[carried.vertices] = np.arange(len(carried))
    of = place[near.vertices]
    rows = np.flatnonzero(of >= 0)
    of, others = of[rows], np.ascontiguousarray(near.triangles[rows])
    points, along = carried.points(x), normals(x, carried.triangles)
    hits, _ = line_hits(x, points[of], along[of], others)
    opposes = np.einsum("kd,kd->k", normals(x, others), along[of]) < 0.0
    gaps = np.full(len(carried), np.inf)
    front = opposes & (hits > LEAST * limit)
    np.minimum.at(gaps, of[front], hits[front])
    wide = np.flatnonzero(gaps >= limit)
    inside = sides(x, points[wide], along[wide], world.body_triangles, LEAST * limit) == INSIDE
    gaps[wide[inside]] = -np.inf
    gaps[carried.far_heights(x) < -LEAST * limit] = -np.inf
    return gaps
