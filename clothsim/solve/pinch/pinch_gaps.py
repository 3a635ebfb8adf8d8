"""Gaps between opposing body surfaces about cloth vertices, at the start and at the end of a step.

A vertex is in a pinch where the gap along the normal of the closest body triangle closes below a limit, or where the
surfaces cross one another.
"""

from dataclasses import dataclass, fields
from typing import Self

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.jit import kernel
from clothsim.mesh.world import World
from clothsim.physics.contact.opposing import CHUNK, INSIDE, Faces, closest, first_hits, line_hit, misses_box, sides
from clothsim.solve.pinch.carried import Carried, normals

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
class Nearest:
    """Cloth vertices (k,) with a body triangle within a distance: the closest one (k, 3), and weights of its point."""

    vertices: Ints
    triangles: Ints
    weights: Floats

    def only(self, rows: Ints) -> Self:
        """Those of some rows of x."""
        return self._chosen(np.isin(self.vertices, rows))

    def without(self, rows: Ints) -> Self:
        """Those but for some rows of x."""
        return self._chosen(~np.isin(self.vertices, rows))

    def _chosen(self, chosen: np.ndarray) -> Self:
        return type(self)(self.vertices[chosen], self.triangles[chosen], self.weights[chosen])


def nearest(faces: Faces, x: Floats, rows: Ints, reach: float) -> Nearest:
    """The closest body triangle within `reach` [m] of rows of x (N, 3) [m]."""
    indices, weights, _ = closest(faces, x, rows, reach)
    found = indices >= 0
    return Nearest(rows[found], faces.triangles[indices[found]], weights[found])


def pinched(faces: Faces, near: Nearest, start: Floats, end: Floats, limit: float, reach: float) -> Sides:
    """Find the vertices about which a gap closes below `limit` [m] between start and end (N, 3) [m].

    The gap is that along the normal of the closest triangle; surfaces that have crossed by more than `reach` [m] are
    not found.
    """
    points = [np.einsum("kc,kcd->kd", near.weights, x[near.triangles]) for x in (start, end)]
    along = [normals(x, near.triangles) for x in (start, end)]
    offset = start[near.vertices] - points[0]
    heights = np.einsum("kd,kd->k", offset, along[0])
    beside = np.linalg.norm(offset - heights[:, None] * along[0], axis=1) > limit
    arrays = faces.triangles, faces.numbers, faces.boxes(end), faces.labels, faces.allowed
    found, weights, gaps = _closing(
        start, end, near.vertices, points[0], along[0], points[1], along[1], heights, beside, *arrays, limit, reach
    )
    chosen = np.flatnonzero(found >= 0)
    far = faces.triangles[found[chosen]]
    return Sides(
        near.vertices[chosen], near.triangles[chosen], near.weights[chosen], far, weights[chosen], gaps[chosen]
    )


@kernel
def _closing(
    start: Floats,
    end: Floats,
    rows: Ints,
    first_points: Floats,
    first_normals: Floats,
    last_points: Floats,
    last_normals: Floats,
    heights: Floats,
    beside: np.ndarray,
    triangles: Ints,
    numbers: Ints,
    boxes: Floats,
    labels: Ints,
    allowed: np.ndarray,
    limit: float,
    reach: float,
) -> tuple[Ints, Floats, Floats]:
    """Opposing triangle of each closest point whose gap closes (k,), -1 where none does, weights, and gap at the end.

    Of several that of the least gap; the vertex is between the two at the start, at a height above the closest point.
    """
    found, weights, gaps = np.full(len(rows), -1), np.zeros((len(rows), 3)), np.full(len(rows), np.inf)
    for k in range(len(rows)):
        if beside[k]:
            continue
        o = (last_points[k, 0], last_points[k, 1], last_points[k, 2])
        d = (last_normals[k, 0], last_normals[k, 1], last_normals[k, 2])
        for chunk in range(len(boxes)):
            if misses_box(o, d, -reach, limit, boxes, chunk):
                continue
            for f in range(CHUNK * chunk, min(CHUNK * (chunk + 1), len(triangles))):
                a, b, c = triangles[f, 0], triangles[f, 1], triangles[f, 2]
                if not allowed[labels[rows[k]], labels[a]]:
                    continue
                t, v, w, facing = line_hit(end, o, d, a, b, c)
                if not (facing < 0.0 and -reach <= t < limit):
                    continue
                gap = 0.0
                for m in range(3):
                    there = (1.0 - v - w) * start[a, m] + v * start[b, m] + w * start[c, m]
                    gap += (there - first_points[k, m]) * first_normals[k, m]
                if not (t < gap - CLOSING * limit and gap > LEAST * limit and heights[k] < gap):
                    continue
                if t < gaps[k] or (t == gaps[k] and numbers[f] < numbers[found[k]]):
                    found[k], gaps[k] = f, t
                    weights[k, 0], weights[k, 1], weights[k, 2] = 1.0 - v - w, v, w
    return found, weights, gaps


def gaps_of(carried: Carried, faces: Faces, world: World, x: Floats, limit: float, reach: float) -> Floats:
    """Gaps in front of the triangles that carry vertices, at x (N, 3), (k,) [m].

    -inf where the parts have crossed, or the triangle is inside another part of the bodies; inf where nothing is in
    front of it within `reach` [m].
    """
    points, along = carried.points(x), normals(x, carried.triangles)
    gaps = first_hits(faces, x, carried.vertices, (points, along), (LEAST * limit, reach), entering=True)
    wide = np.flatnonzero(gaps >= limit)
    inside = sides(x, points[wide], along[wide], world.body_triangles, LEAST * limit) == INSIDE
    gaps[wide[inside]] = -np.inf
    gaps[carried.far_heights(x) < -LEAST * limit] = -np.inf
    return gaps
