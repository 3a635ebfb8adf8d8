"""Level sets of a scalar field on a triangle surface: sections by planes and rings at a geodesic distance."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, QhullError

from transfer.triangle_surface import Floats, Ints


@dataclass(frozen=True)
class Ring:
    """Level set of a field.

    Attributes
    ----------
    starts, ends : ndarray (s, 3)
        Ends of its segments, one for each triangle that it crosses [m].
    triangles : ndarray (s,)
        Those triangles.
    """

    starts: Floats
    ends: Floats
    triangles: Ints

    @property
    def lengths(self) -> Floats:
        """Length of each segment, (s,) [m]."""
        return np.asarray(np.linalg.norm(self.ends - self.starts, axis=1))

    @property
    def centre(self) -> Floats:
        """Centroid of the curve, (3,) [m]."""
        lengths = self.lengths
        return np.asarray(lengths @ (self.starts + self.ends) / (2.0 * lengths.sum()))

    @property
    def radius(self) -> float:
        """Root mean square distance of the curve from its centroid [m]."""
        lengths = self.lengths
        squared = (((self.starts + self.ends) / 2.0 - self.centre) ** 2).sum(axis=1)
        return float(np.sqrt(lengths @ squared / lengths.sum()))

    def only(self, chosen: NDArray[np.bool_]) -> "Ring":
        """Ring of the segments where `chosen` (s,) is true."""
        return Ring(self.starts[chosen], self.ends[chosen], self.triangles[chosen])


def level_set(positions: Floats, triangles: Ints, field: Floats, level: float) -> Ring:
    """Curve on which the piecewise linear `field` (n,) has the value `level`; without segments where none has."""
    values = field[triangles] - level
    above = values > 0
    crossed = np.flatnonzero(np.isfinite(values).all(axis=1) & above.any(axis=1) & ~above.all(axis=1))
    corners, values, above = triangles[crossed], values[crossed], above[crossed]
    single = np.where(above.sum(axis=1) == 1, above.argmax(axis=1), above.argmin(axis=1))
    rows = np.arange(len(crossed))
    ends = []
    for offset in (1, 2):
        other = (single + offset) % 3
        at, to = values[rows, single], values[rows, other]
        t = (at / (at - to))[:, None]
        ends.append((1.0 - t) * positions[corners[rows, single]] + t * positions[corners[rows, other]])
    return Ring(ends[0], ends[1], crossed)


def loops(ring: Ring, triangles: Ints) -> list[Ring]:
    """Connected pieces of a level set, the longest first."""
    crossed = triangles[ring.triangles]
    other = crossed[:, [1, 2, 0]]
    keys = np.minimum(crossed, other) * (crossed.max(initial=0) + 1) + np.maximum(crossed, other)
    numbers = np.unique(keys, return_inverse=True)[1].reshape(-1, 3)
    # A segment's triangle shares an edge with the next one; three edges a triangle, of which the curve crosses two.
    count, width = len(crossed), int(numbers.max(initial=-1)) + 1
    incidence = csr_array((np.ones(3 * count), (np.repeat(np.arange(count), 3), numbers.ravel())), shape=(count, width))
    _, labels = connected_components(incidence @ incidence.T, directed=False)
    pieces = [ring.only(labels == label) for label in range(int(labels.max(initial=-1)) + 1)]
    return sorted(pieces, key=lambda piece: -float(piece.lengths.sum()))


def girth(ring: Ring) -> float:
    """Length of a tape about a ring: perimeter of its convex hull in its plane of least squares [m]."""
    points = np.concatenate([ring.starts, ring.ends])
    if len(points) < 6:
        return 0.0
    axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2][:2]
    flat = (points - points.mean(axis=0)) @ axes.T
    try:
        return float(ConvexHull(flat).area)  # in two dimensions scipy's `area` is the perimeter
    except QhullError:
        return 0.0
