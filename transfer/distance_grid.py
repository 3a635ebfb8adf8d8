"""Signed distance of a body on a regular grid, interpolated trilinearly.

For losses that ask the distance of many points many times; what is decided is decided by the exact test.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import map_coordinates

from transfer.errors import TransferError
from transfer.signed_distance import BodySurface
from transfer.triangle_surface import Floats, as_points

MOST_NODES = 4_000_000


@dataclass(frozen=True, eq=False)
class DistanceGrid:
    """Signed distances at the nodes of a grid.

    Attributes
    ----------
    origin : (3,) ndarray
        First node [m].
    spacing : float
        Between nodes [m].
    values : (i, j, k) ndarray
        Signed distances, negative inside [m].
    """

    origin: Floats
    spacing: float
    values: Floats

    def cells(self, points: ArrayLike) -> Floats:
        """Positions (3, n) of points (n, 3) [m] in units of the spacing, for interpolation of `values`."""
        return (np.asarray(points, np.float64) - self.origin).T / self.spacing

    def signed_distance(self, points: ArrayLike) -> Floats:
        """Interpolated distances (n,) [m]; outside of the grid those at its boundary."""
        found = map_coordinates(self.values, self.cells(as_points("points", points)), order=1, mode="nearest")
        return np.asarray(found, np.float64)


def distance_grid(body: BodySurface, points: ArrayLike, spacing: float = 0.01, margin: float = 0.05) -> DistanceGrid:
    """Grid about points.

    Parameters
    ----------
    body : BodySurface
    points : (n, 3) array_like
        The grid covers their box and a margin [m].
    spacing, margin : float
        [m].

    Raises
    ------
    TransferError
        For a spacing that is not above 0, or more than MOST_NODES nodes.
    """
    given = as_points("points", points)
    if not (spacing > 0 and margin >= 0):
        raise TransferError(f"spacing is {spacing}, margin {margin}.", "Give a spacing above 0 and a margin from 0.")
    origin = given.min(axis=0) - margin
    counts = np.ceil((given.max(axis=0) + margin - origin) / spacing).astype(int) + 1
    if np.prod(counts, dtype=float) > MOST_NODES:
        raise TransferError(f"The grid would have {np.prod(counts, dtype=float):.3g} nodes.", "Give a larger spacing.")
    axes = [origin[k] + spacing * np.arange(counts[k]) for k in range(3)]
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    return DistanceGrid(origin, spacing, body.closest(nodes).signed_distance.reshape(counts))
