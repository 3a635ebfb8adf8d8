"""Consistent winding of orientable surfaces, and the generalised winding number of a point.

Winding is a flood fill over edges; each component by majority, or away from a body. The winding number tells whether a
body contains a point, exactly for closed surfaces however they overlap.
"""

import numpy as np
from numpy.typing import NDArray

from clothsim.base.arrays import Floats, Ints
from clothsim.mesh.manifold import joined_half_edges, turned_triangles
from clothsim.mesh.topology import components


def wound(triangles: Ints, n_vertices: int) -> tuple[Ints, NDArray[np.bool_]]:
    """Return triangles wound as most of their component, and which of them were turned.

    Triangles that are not sound (indices out of range, a corner twice), and components without two sides, stay as they
    are: the mesh checks name them.

    Parameters
    ----------
    triangles : (m, 3) int64
        Vertex indices.
    n_vertices : int
        Number of vertices.

    Returns
    -------
    triangles : (m, 3) int64
        The same array where none was turned. A turned triangle has its second and third corner swapped.
    turned : (m,) bool

    Examples
    --------
    >>> wound(np.array([[0, 1, 2], [2, 1, 3], [2, 4, 3]]), 5)[1].tolist()
    [False, False, True]
    """
    turned = np.zeros(len(triangles), bool)
    sound = ((triangles >= 0) & (triangles < n_vertices)).all(axis=1)
    sound &= (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
    rows = np.flatnonzero(sound)
    if len(rows):
        own = triangles[rows]
        turned[rows[turned_triangles(own, joined_half_edges(own))[0]]] = True
    return (_swapped(triangles, turned) if turned.any() else triangles), turned


def facing_away(positions: Floats, triangles: Ints, body: Floats, turned: NDArray[np.bool_]) -> Ints:
    """Return triangles in which each component with a turned triangle faces away from a body.

    Parameters
    ----------
    positions : (n, 3) float64
        Vertices [m].
    triangles : (m, 3) int64
        Consistently wound.
    body : (k, 3) float64
        Vertices of the body [m]: the area that faces away from the nearest of them decides.
    turned : (m,) bool
        Triangles that `wound` turned.
    """
    from scipy.spatial import cKDTree

    corners = positions[triangles]
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    centres = corners.mean(axis=1)
    away = centres - body[cKDTree(body).query(centres)[1]]
    distance = np.linalg.norm(away, axis=1, keepdims=True)
    outward = np.einsum("ij,ij->i", areas, away / np.where(distance > 0, distance, 1.0))
    piece = components(triangles, len(positions))[triangles[:, 0]]
    inwards = np.bincount(piece, outward)[piece] < 0
    changed = np.bincount(piece, turned)[piece] > 0
    return _swapped(triangles, inwards & changed)


def _swapped(triangles: Ints, chosen: NDArray[np.bool_]) -> Ints:
    return np.where(chosen[:, None], triangles[:, [0, 2, 1]], triangles)


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
