"""Overlap of a body with itself, as of thighs, in which a garment has no room: opened for it, and closed on it.

The body is pressed in by a few millimetres about the points at which it intersects itself. The garment grows onto that
shape under contact; in its drape the body closes again, and one part carries the vertices between (`solve.pinch`).
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from clothsim.base.arrays import Floats, Ints
from clothsim.engine import intersecting_pairs, intersection_points
from clothsim.garments.fit.guaranteed_path import deflated, half_thickness, outward_normals
from transfer.signed_distance import BodySurface

DEPTHS = (0.006, 0.012)
"""Depths by which a body is pressed in at an overlap [m], in the order in which they are tried."""
NEAR = 0.06
"""Distance from a point within which an overlap is there, as a fraction of the body's largest extent."""
LINKED = 0.03
"""Distance within which points belong to one overlap, as such a fraction."""
WHOLE, NONE = 0.018, 0.055
"""Distances from the overlap up to which, and from which on, the depth is whole and none, as such fractions."""


@dataclass(frozen=True)
class Overlap:
    """Overlap of a body with itself.

    Parameters
    ----------
    points : (k, 3) array
        Points at which triangles of the body intersect one another [m].
    opened : (n, 3) array
        The body, pressed in about them [m].
    depth : float
        Depth of that [m].
    reach : float
        Distance from the points within which it is pressed in [m].
    """

    points: Floats
    opened: Floats
    depth: float
    reach: float

    def __len__(self) -> int:
        return len(self.points)

    def holds(self, positions: Floats) -> np.ndarray:
        """Mask (m,) of the positions (m, 3) [m] that are where the body is pressed in."""
        return np.asarray(_distances(self.points, positions) < self.reach)

    @property
    def where(self) -> str:
        """Their mean as text."""
        return f"near ({', '.join(f'{value:.3g}' for value in self.points.mean(axis=0))}) m"


NO_OVERLAP = Overlap(np.zeros((0, 3)), np.zeros((0, 3)), 0.0, 0.0)


def overlaps_at(body: BodySurface, place: Floats) -> Iterator[Overlap]:
    """Yield the overlap that begins near a place (3,) [m], at each of the DEPTHS; nothing where none does."""
    pairs = intersecting_pairs(body.positions, body.triangles)
    points = intersection_points(body.positions, body.triangles, body.triangles, pairs)
    extent = float(np.ptp(body.positions, axis=0).max())
    if not len(points):
        return
    points = _connected(points, np.linalg.norm(points - place, axis=1) < NEAR * extent, LINKED * extent)
    if not len(points):
        return
    left = (NONE * extent - _distances(points, body.positions)) / ((NONE - WHOLE) * extent)
    left = np.clip(left, 0.0, 1.0)
    weights = left * left * (3.0 - 2.0 * left)
    half, normals = half_thickness(body), outward_normals(body)
    for depth in DEPTHS:
        inward = deflated(body, depth, half, normals) - body.positions
        yield Overlap(points, body.positions + weights[:, None] * inward, depth, NONE * extent)


def carried_rows(overlap: Overlap, positions: Floats, carried: np.ndarray) -> Ints:
    """Rows of the vertices (n, 3) [m] that are marked as carried (n,) where the body overlaps itself."""
    return np.flatnonzero(carried & overlap.holds(positions)).astype(np.int64)


def _connected(points: Floats, chosen: np.ndarray, distance: float) -> Floats:
    """The chosen points (k, 3), and those that a chain of points no further than `distance` apart joins to them [m]."""
    one, other = cKDTree(points).query_pairs(distance, output_type="ndarray").T
    links = coo_array((np.ones(len(one)), (one, other)), shape=(len(points), len(points)))
    _, label = connected_components(links, directed=False)
    return np.asarray(points[np.isin(label, label[chosen])], np.float64)


def _distances(points: Floats, positions: Floats) -> Floats:
    """Distances (m,) of positions (m, 3) to the nearest of the points (k, 3) [m]."""
    return np.asarray(cKDTree(points).query(positions)[0], np.float64)
