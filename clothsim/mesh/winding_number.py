"""Generalised winding number: containment of a point in a body, exact for closed surfaces however they overlap."""

import numpy as np

from clothsim.base.arrays import Floats, Ints


def winding_number(point: Floats, positions: Floats, triangles: Ints) -> float:
    """Return the winding number of `triangles (m, 3)` about `point (3,)`: 1 inside, 0 outside, fractional near holes.

    The sum of the triangles' solid angles over 4 pi (Van Oosterom & Strackee 1983, eq. 8; Jacobson et al. 2013).
    """
    a, b, c = (positions[triangles[:, corner]] - point for corner in range(3))
    la, lb, lc = (np.linalg.norm(side, axis=1) for side in (a, b, c))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c))
    ab, bc, ca = (np.einsum("ij,ij->i", one, other) for one, other in ((a, b), (b, c), (c, a)))
    angles = 2 * np.arctan2(volume, la * lb * lc + ab * lc + bc * la + ca * lb)
    return float(angles.sum() / (4 * np.pi))


def is_inside(point: Floats, positions: Floats, triangles: Ints) -> bool:
    """Return True where `point (3,)` is inside a body of either winding."""
    return abs(winding_number(point, positions, triangles)) > 0.5
