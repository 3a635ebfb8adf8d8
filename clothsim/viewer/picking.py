"""Vertex of a surface that a ray meets first."""

import numpy as np

from clothsim.base.arrays import Floats, Ints


def picked_vertex(positions: Floats, triangles: Ints, origin: Floats, direction: Floats) -> int | None:
    """Number of the vertex nearest to where a ray first meets the triangles; None where it meets none.

    Moller and Trumbore 1997, from both sides.

    Examples
    --------
    >>> import numpy as np
    >>> square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    >>> picked_vertex(square, np.array([[0, 1, 2], [0, 2, 3]]), np.array([0.9, 0.2, 1]), np.array([0, 0, -1.0]))
    1
    """
    a, b, c = (positions[triangles[:, k]] for k in range(3))
    first, second = b - a, c - a
    across = np.cross(direction, second)
    volume = np.einsum("ij,ij->i", first, across)
    with np.errstate(divide="ignore", invalid="ignore"):
        from_a = origin - a
        u = np.einsum("ij,ij->i", from_a, across) / volume
        other = np.cross(from_a, first)
        v = other @ direction / volume
        distance = np.einsum("ij,ij->i", second, other) / volume
        met = (u >= 0) & (v >= 0) & (u + v <= 1) & (distance > 0)
    if not met.any():
        return None
    row = int(np.argmin(np.where(met, distance, np.inf)))
    point = origin + distance[row] * direction
    corners = triangles[row]
    return int(corners[np.argmin(np.linalg.norm(positions[corners] - point, axis=1))])
