"""Body surfaces about cloth vertices: closest triangles, lines that meet them, and the gaps that close in a step.

A vertex is in a pinch where the gap along the normal of the closest body triangle closes below a limit, or where the
surfaces cross one another.
"""

from dataclasses import dataclass, fields
from typing import Self

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.jit import kernel, part
from clothsim.base.triangles import area_vectors
from clothsim.base.vectors import cross, dot, minus
from clothsim.physics.contact.bvh import hilbert_order
from clothsim.physics.contact.distance import point_triangle_closest
from clothsim.physics.contact.surface import ContactSurface

# Body surfaces about points: closest triangles, and triangles that lines meet.
#
# The triangles are taken in chunks that follow one another along a Hilbert curve; a chunk whose box is out of reach is
# passed over. What is found does not depend on the chunks: of equal distances that of the lowest triangle counts.


OUTSIDE, NONE, INSIDE = -1, 0, 1
CHUNK = 16
"""Triangles of a chunk."""
SLACK = 1e-9
"""Relative enlargement of the boxes, for round-off."""


@dataclass(frozen=True, eq=False)
class Faces:
    """Body triangles in chunks, and which cloth vertices they may touch.

    Attributes
    ----------
    triangles : (m, 3) int array
        Rows of x, along the curve.
    numbers : (m,) int array
        Number of each in the surface.
    labels : (N,) int array
        Object of each row of x.
    allowed : (L, L) bool array
        Pairs of objects that may touch.
    """

    triangles: Ints
    numbers: Ints
    labels: Ints
    allowed: np.ndarray

    def boxes(self, x: Floats) -> Floats:
        """Lower and upper corners of the chunks at x (N, 3), (c, 6) [m]."""
        if not len(self.triangles):
            return np.zeros((0, 6))
        corners, starts = x[self.triangles], np.arange(0, len(self.triangles), CHUNK)
        low, high = np.minimum.reduceat(corners.min(axis=1), starts), np.maximum.reduceat(corners.max(axis=1), starts)
        slack = SLACK * (np.abs(corners).max() + 1e-300)
        return np.hstack([low - slack, high + slack])


def frames(x: Floats, triangles: Ints) -> Floats:
    """Orthonormal frames of triangles (k, 3), (k, 3, 3): its rows are the first edge, the other tangent, the normal."""
    corners = x[triangles]
    tangent, normal = corners[:, 1] - corners[:, 0], normals(x, triangles)
    tangent = tangent / np.linalg.norm(tangent, axis=1, keepdims=True)
    return np.stack([tangent, np.cross(normal, tangent), normal], axis=1)


def normals(x: Floats, triangles: Ints) -> Floats:
    """Unit normals of triangles (k, 3), (k, 3)."""
    normal = area_vectors(x[triangles])
    return np.asarray(normal / np.linalg.norm(normal, axis=1, keepdims=True))


def faces_of(surface: ContactSurface, x: Floats) -> Faces:
    """The triangles of the second group of a surface, in chunks by where they are at x (N, 3) [m]."""
    triangles = surface.second.triangles
    order = hilbert_order(triangles, x, x)
    return Faces(np.ascontiguousarray(triangles[order]), order, surface.labels, surface.allowed)


def closest(faces: Faces, x: Floats, rows: Ints, reach: float) -> tuple[Ints, Floats, Floats]:
    """Closest triangle of rows of x (k,) within `reach` [m], by its index in `faces`; -1 where there is none.

    Returns
    -------
    indices : (k,) int array
    weights : (k, 3) array
        Of its corners, at the closest point.
    distances : (k,) array [m]
    """
    return _closest(x, rows, faces.triangles, faces.numbers, faces.boxes(x), faces.labels, faces.allowed, reach)


def line_hits(
    faces: Faces, x: Floats, rows: Ints, lines: tuple[Floats, Floats], span: tuple[float, float], entering: bool
) -> Floats:
    """Least t [1] of a span at which the line o + t d of each row of x meets a triangle, (k,); inf where none does.

    lines: o and d (k, 3); entering: only triangles whose normal opposes d.
    """
    origins, directions = (np.ascontiguousarray(each) for each in lines)
    arrays = faces.triangles, faces.boxes(x), faces.labels, faces.allowed
    return np.asarray(_first_hits(x, rows, origins, directions, *arrays, span[0], span[1], entering))


@kernel
def _closest(
    x: Floats,
    rows: Ints,
    triangles: Ints,
    numbers: Ints,
    boxes: Floats,
    labels: Ints,
    allowed: np.ndarray,
    reach: float,
) -> tuple[Ints, Floats, Floats]:
    """Compiled part of `closest`."""
    indices, weights, distances = np.full(len(rows), -1), np.zeros((len(rows), 3)), np.full(len(rows), np.inf)
    for k in range(len(rows)):
        i, best = rows[k], reach
        p = (x[i, 0], x[i, 1], x[i, 2])
        for chunk in range(len(boxes)):
            squared = 0.0
            for m in range(3):
                outside = max(boxes[chunk, m] - p[m], p[m] - boxes[chunk, 3 + m], 0.0)
                squared += outside * outside
            if squared > best * best:
                continue
            for f in range(CHUNK * chunk, min(CHUNK * (chunk + 1), len(triangles))):
                a, b, c = triangles[f, 0], triangles[f, 1], triangles[f, 2]
                if not allowed[labels[i], labels[a]]:
                    continue
                u, v, w = point_triangle_closest(
                    p, (x[a, 0], x[a, 1], x[a, 2]), (x[b, 0], x[b, 1], x[b, 2]), (x[c, 0], x[c, 1], x[c, 2])
                )
                squared = 0.0
                for m in range(3):
                    squared += (p[m] - u * x[a, m] - v * x[b, m] - w * x[c, m]) ** 2
                distance = np.sqrt(squared)
                lower = indices[k] < 0 or numbers[f] < numbers[indices[k]]
                if distance < best or (distance == best and lower):
                    best = distance
                    indices[k], distances[k] = f, distance
                    weights[k, 0], weights[k, 1], weights[k, 2] = u, v, w
    return indices, weights, distances


@kernel
def _first_hits(
    x: Floats,
    rows: Ints,
    origins: Floats,
    directions: Floats,
    triangles: Ints,
    boxes: Floats,
    labels: Ints,
    allowed: np.ndarray,
    low: float,
    high: float,
    entering: bool,
) -> Floats:
    """Compiled part of `line_hits`."""
    hits = np.full(len(rows), np.inf)
    for k in range(len(rows)):
        o = (origins[k, 0], origins[k, 1], origins[k, 2])
        d = (directions[k, 0], directions[k, 1], directions[k, 2])
        for chunk in range(len(boxes)):
            if misses_box(o, d, low, min(high, hits[k]), boxes, chunk):
                continue
            for f in range(CHUNK * chunk, min(CHUNK * (chunk + 1), len(triangles))):
                if not allowed[labels[rows[k]], labels[triangles[f, 0]]]:
                    continue
                t, _, _, facing = line_hit(x, o, d, triangles[f, 0], triangles[f, 1], triangles[f, 2])
                if facing != 0.0 and (facing < 0.0 or not entering) and low <= t <= high:
                    hits[k] = min(hits[k], t)
    return hits


@kernel
def sides(x: Floats, origins: Floats, directions: Floats, triangles: Ints, least: float) -> Ints:
    """Side of closed surfaces on which the origins are, by the first hit beyond `least` [m] of the ray o + t d.

    INSIDE where it leaves a surface, OUTSIDE where it enters one, NONE where it meets none.
    """
    found = np.zeros(len(origins), np.int64)
    for k in range(len(origins)):
        o = (origins[k, 0], origins[k, 1], origins[k, 2])
        d = (directions[k, 0], directions[k, 1], directions[k, 2])
        nearest = np.inf
        for f in range(len(triangles)):
            t, _, _, facing = line_hit(x, o, d, triangles[f, 0], triangles[f, 1], triangles[f, 2])
            if facing != 0.0 and least < t < nearest:
                nearest = t
                found[k] = INSIDE if facing > 0.0 else OUTSIDE
    return found


@part
def misses_box(o, d, low, high, boxes, box):
    """True where no o + t d with low <= t <= high is in the bounds of the segment and in the box."""
    for m in range(3):
        one, two = o[m] + low * d[m], o[m] + high * d[m]
        if max(one, two) < boxes[box, m] or min(one, two) > boxes[box, 3 + m]:
            return True
    return False


@part
def line_hit(x, o, d, i, j, k):
    """t, the weights of j and k, and d . n where the line o + t d meets a triangle; d . n = 0 where it misses."""
    a = (x[i, 0], x[i, 1], x[i, 2])
    e, f = minus((x[j, 0], x[j, 1], x[j, 2]), a), minus((x[k, 0], x[k, 1], x[k, 2]), a)
    n = cross(e, f)
    facing = dot(d, n)
    if abs(facing) <= 1e-12 * np.sqrt(dot(n, n)):
        return 0.0, 0.0, 0.0, 0.0
    r = minus(a, o)
    t = dot(r, n) / facing
    q = cross(d, r)
    v, w = -dot(f, q) / facing, dot(e, q) / facing
    if min(v, w, 1.0 - v - w) < -1e-9:
        return 0.0, 0.0, 0.0, 0.0
    return t, v, w, facing


LEAST = 1e-2
"""Fraction of the limit below which a hit is of the same surface, at a fold."""
CLOSING = 1e-6
"""Fraction of the limit by which a gap must close in a step: a body at rest or moving rigidly pinches nothing."""


@dataclass(frozen=True)
class PinchedVertices:
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


def nearest_faces(faces: Faces, x: Floats, rows: Ints, reach: float) -> Nearest:
    """The closest body triangle within `reach` [m] of rows of x (N, 3) [m]."""
    indices, weights, _ = closest(faces, x, rows, reach)
    found = indices >= 0
    return Nearest(rows[found], faces.triangles[indices[found]], weights[found])


def pinched(faces: Faces, near: Nearest, start: Floats, end: Floats, limit: float, reach: float) -> PinchedVertices:
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
    return PinchedVertices(
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
