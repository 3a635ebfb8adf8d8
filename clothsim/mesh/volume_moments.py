"""Volume moments of a closed surface: volume, centroid and covariance of the solid inside.

Sums over the tetrahedra from a point near the surface to its triangles, with the sign of their volumes (Mirtich 1996,
"Fast and accurate computation of polyhedral mass properties").
"""

from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats, Ints


@dataclass(frozen=True)
class VolumeMoments:
    """Moments of a solid of density 1.

    Parameters
    ----------
    volume : float
        [m3]; negative where the triangles face inwards.
    centroid : (3,) float64
        [m].
    covariance : (3, 3) float64
        Mean of (X - centroid)(X - centroid)' over the solid [m2].
    """

    volume: float
    centroid: Floats
    covariance: Floats


def volume_moments(positions: Floats, triangles: Ints) -> VolumeMoments:
    """Return the moments of the solid inside a closed surface.

    Parameters
    ----------
    positions : (n, 3) float64
        Vertices [m].
    triangles : (m, 3) int64
        Triangles that face outwards.

    Returns
    -------
    VolumeMoments

    Examples
    --------
    A tetrahedron with three edges of 1 m along the axes:

    >>> import numpy as np
    >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> moments = volume_moments(corners, np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]))
    >>> round(6 * moments.volume, 12), moments.centroid
    (1.0, array([0.25, 0.25, 0.25]))
    """
    middle = positions.mean(axis=0)
    corners = positions[triangles] - middle
    volumes = np.linalg.det(corners) / 6
    volume = float(volumes.sum())
    if not volume:
        return VolumeMoments(0.0, middle, np.zeros((3, 3)))
    sums = corners.sum(axis=1)
    centroid = (volumes @ sums) / (4 * volume)
    # integral of X X' over the tetrahedron (0, a, b, c): V/20 (aa' + bb' + cc' + ss'), s = a + b + c
    second = np.einsum("t,tki,tkj->ij", volumes, corners, corners) + np.einsum("t,ti,tj->ij", volumes, sums, sums)
    covariance = second / (20 * volume) - np.outer(centroid, centroid)
    return VolumeMoments(volume, middle + centroid, 0.5 * (covariance + covariance.T))
