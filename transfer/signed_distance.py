"""Signed distance to a body: closest point and outward normal, by libigl.

Inside is where the generalised winding number is above one half (Jacobson, Kavan & Sorkine-Hornung 2013; fast form of
Barill et al. 2018), so a body may intersect itself, consist of several pieces and have holes. Triangles oriented
inward are reversed. Parts of the surface inside the body itself (where pieces overlap) are excluded: the closest point
lies on the outside of the union.
"""

import os
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import igl
import numpy as np
from numpy.typing import ArrayLike

from transfer.errors import TransferError
from transfer.triangle_surface import Floats, Ints, as_points, as_surface, triangle_normals, unit, vertex_normals

THREADS = 4
"""Most threads of libigl, unless the variable IGL_NUM_THREADS is set."""
SKIN = 1e-5
"""Offset of a point just outside a triangle along its normal, as a fraction of the body's size."""
HOLLOW = 1e-4
"""A piece with a volume below this fraction of that of the ball with the same area is a sheet, not a body."""


@dataclass(frozen=True)
class Closest:
    """Closest points of a body to k query points.

    Attributes
    ----------
    signed_distance : ndarray (k,)
        Negative inside [m].
    points : ndarray (k, 3)
        Closest points on the body [m].
    normals : ndarray (k, 3)
        Unit outward normals there: the gradient of the signed distance.
    triangles : ndarray (k,)
        Body triangle of each closest point.
    """

    signed_distance: Floats
    points: Floats
    normals: Floats
    triangles: Ints

    @property
    def inside(self) -> np.ndarray:
        """True for points inside the body, (k,); points on the surface are not inside."""
        return np.less(self.signed_distance, 0)


@dataclass(frozen=True)
class Penetration:
    """Number of points inside, depth of the deepest [m], and its index (-1: none)."""

    count: int
    depth: float
    worst: int


@dataclass(frozen=True)
class BodySurface:
    """Body with a search tree for distance queries; made by `body_surface`.

    Attributes
    ----------
    positions : ndarray (n, 3)
        Vertices [m].
    triangles : ndarray (m, 3)
        Triangles, oriented outward.
    outer : ndarray (k,)
        Triangles that are not inside the body itself.
    open_edges : int
        Number of edges with one triangle (0: watertight).
    """

    positions: Floats
    triangles: Ints
    outer: Ints
    open_edges: int
    _tree: Any = field(repr=False, compare=False)
    _expansions: Any = field(repr=False, compare=False)

    def closest(self, points: ArrayLike) -> Closest:
        """Closest points of the body.

        Parameters
        ----------
        points : array_like (k, 3)
            Query points [m].

        Raises
        ------
        TransferError
            `points` has another shape or values that are not finite.
        """
        queries = as_points("points", points)
        if not len(queries):
            return Closest(np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, np.int64))
        squared, rows, closest = self._tree.squared_distance(self.positions, self.triangles[self.outer], queries)
        triangles, closest = self.outer[rows.ravel()], closest.reshape(-1, 3)
        distance = np.sqrt(squared.ravel())
        sign = np.where(self._expansions.winding_number(queries) > 0.5, -1.0, 1.0)
        normals = unit(sign[:, None] * (queries - closest))
        # On the surface itself interpolated vertex normals: at an edge or a corner the direction to the point is the
        # one in which the distance grows, and no triangle's is.
        touching = distance < SKIN * self.size
        corners = self.triangles[triangles[touching]]
        weights = barycentric(self.positions[corners], closest[touching])
        smooth = unit((weights[:, :, None] * self.vertex_normals[corners]).sum(axis=1))
        flat = self.triangle_normals[triangles[touching]]
        normals[touching] = np.where((smooth * flat).sum(axis=1, keepdims=True) > 0, smooth, flat)
        return Closest(sign * distance, closest, normals, triangles)

    def penetration(self, points: ArrayLike) -> Penetration:
        """Number and depth of `points` (k, 3) [m] inside the body."""
        distance = self.closest(points).signed_distance
        count = int((distance < 0).sum())
        worst = int(np.argmin(distance)) if count else -1
        return Penetration(count, float(-distance[worst]) if count else 0.0, worst)

    def exits(self, points: Floats, directions: Floats) -> tuple[Floats, Ints]:
        """First hits of rays (k, 3) from `points` along `directions`: distances [m], triangles (k,); or inf, -1."""
        triangles, distance, _ = self._tree.intersect_ray_first(
            self.positions, self.triangles[self.outer], np.ascontiguousarray(points), np.ascontiguousarray(directions)
        )
        met = np.logical_and(triangles.ravel() >= 0, np.isfinite(distance.ravel()))
        return np.where(met, distance.ravel(), np.inf), np.where(met, self.outer[triangles.ravel()], -1)

    @cached_property
    def vertex_normals(self) -> Floats:
        """Outward unit normals at the vertices, (n, 3), weighted by angle."""
        return vertex_normals(self.positions, self.triangles)

    @cached_property
    def triangle_normals(self) -> Floats:
        """Outward unit normals of the triangles, (m, 3)."""
        return triangle_normals(self.positions, self.triangles)

    @cached_property
    def size(self) -> float:
        """Diagonal of the bounding box [m]."""
        return float(np.linalg.norm(np.ptp(self.positions[self.triangles.ravel()], axis=0)))


def body_surface(positions: ArrayLike, triangles: ArrayLike) -> BodySurface:
    """Prepare a body for distance queries.

    Parameters
    ----------
    positions : array_like (n, 3)
        Vertices [m].
    triangles : array_like (m, 3)
        Triangles in any orientation, open or closed.

    Raises
    ------
    TransferError
        Invalid arrays, or no component encloses a volume, so that inside is undefined.

    Examples
    --------
    >>> import numpy as np
    >>> from transfer.signed_distance import body_surface
    >>> x = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    >>> body = body_surface(x, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    >>> body.closest([[0.2, 0.2, -0.5], [0.2, 0.2, 0.1]]).signed_distance.round(3).tolist()
    [0.5, -0.1]
    """
    points, given = as_surface("body", positions, triangles)
    os.environ.setdefault("IGL_NUM_THREADS", str(min(THREADS, os.cpu_count() or 1)))
    faces = _turned_outward(points, given)
    normals = triangle_normals(points, faces)
    size = float(np.linalg.norm(np.ptp(points[faces.ravel()], axis=0)))
    above = points[faces].mean(axis=1) + SKIN * size * normals
    expansions = igl.FastWindingNumberBVH()  # built once: 35 times the cost of the winding numbers of 500 points
    expansions.init(points, faces)
    buried = np.logical_or(expansions.winding_number(above) > 0.5, ~normals.any(axis=1))
    outer = np.flatnonzero(~buried)
    if not len(outer):
        raise TransferError("The body has no outside: each of its triangles has the body on both sides.")
    tree = igl.AABB()
    tree.init(points, np.ascontiguousarray(faces[outer]))
    half = np.sort(np.concatenate([given[:, [0, 1]], given[:, [1, 2]], given[:, [2, 0]]]), axis=1)
    open_edges = int((np.unique(half, axis=0, return_counts=True)[1] == 1).sum())
    return BodySurface(points, faces, outer, open_edges, tree, expansions)


def barycentric(corners: Floats, points: Floats) -> Floats:
    """Barycentric coordinates (k, 3) of `points` (k, 3) in triangles with corners (k, 3, 3) (Ericson 2004)."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    c = points - corners[:, 0]
    aa, ab, bb = (a * a).sum(axis=1), (a * b).sum(axis=1), (b * b).sum(axis=1)
    ca, cb = (c * a).sum(axis=1), (c * b).sum(axis=1)
    area = aa * bb - ab * ab
    safe = np.where(area > 0, area, 1.0)
    v, w = (bb * ca - ab * cb) / safe, (aa * cb - ab * ca) / safe
    return np.column_stack([1 - v - w, v, w])


def _turned_outward(points: Floats, given: Ints) -> Ints:
    """Triangles (m, 3) oriented consistently in each component, with positive volume."""
    faces, pieces = igl.bfs_orient(given)
    faces, pieces = np.ascontiguousarray(faces, np.int64), np.asarray(pieces).ravel()
    corners = points[faces]
    doubled = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.bincount(pieces, 0.5 * np.linalg.norm(doubled, axis=1))
    middles = corners.mean(axis=1)
    count = np.bincount(pieces)
    centre = np.column_stack([np.bincount(pieces, middles[:, k]) for k in range(3)]) / count[:, None]
    volume = np.bincount(pieces, ((middles - centre[pieces]) * doubled).sum(axis=1) / 6)
    if not (np.abs(volume) > HOLLOW * area**1.5 / (6 * np.sqrt(np.pi))).any():
        raise TransferError(
            "The body encloses no volume: it is a flat sheet.", "Give a closed body; small holes are allowed."
        )
    inward = (volume < 0)[pieces]
    faces[inward] = faces[inward][:, [0, 2, 1]]
    return faces
