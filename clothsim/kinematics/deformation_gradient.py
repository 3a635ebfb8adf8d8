"""The deformation gradient of each triangle, F (3x2), and the frame that its rest shape has in space."""

import numpy as np
from numpy.typing import NDArray

from clothsim.arrays import Floats, Ints
from clothsim.errors import InputError


def deformation_gradients(
    positions: NDArray[np.floating], triangles: Ints, rest_shape_inverses: NDArray[np.floating]
) -> NDArray[np.floating]:
    """F = [x1 - x0, x2 - x0] Dm^-1 of each triangle, (m, 3, 2): material plane to space, dimensionless.

    positions: (n, 3) [m]; triangles: (m, 3); rest_shape_inverses: (m, 2, 2) [1/m], Dm = [e1 e2] at rest.
    A triangle twice its rest size has F'F = 4 I. float32 where both arrays are.
    """
    corners = positions[triangles]
    edges = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=2)
    return edges @ rest_shape_inverses


def area_ratios(F: NDArray[np.floating]) -> NDArray[np.floating]:
    """J = |f1 x f2| = l1 l2, deformed area over rest area, (...) of F (..., 3, 2)."""
    return np.linalg.norm(np.cross(F[..., 0], F[..., 1]), axis=-1)


def reference_frames(rest_positions: Floats, triangles: Ints) -> Floats:
    """Orthonormal t1, t2, n of each triangle as the columns of (m, 3, 3).

    t1 = e1/|e1|, n = e1 x e2/|e1 x e2|, t2 = n x t1: the plane in which a cloth without a flat pattern has its
    material coordinates. Column pair [t1 t2] carries a material direction into the space of `rest_positions (n, 3)`;
    for a deformed shape that is the R of `stretch.decompose`. InputError names a triangle without area.
    """
    corners = rest_positions[triangles]
    edge1, edge2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(edge1, edge2)
    length, area = np.linalg.norm(edge1, axis=1), np.linalg.norm(normal, axis=1)
    bad = np.flatnonzero(~(area > 0))
    if bad.size:
        raise InputError(
            f"triangle {bad[0]} has no area, so it has no frame ({bad.size} such triangles).",
            "Remove it or merge its vertices.",
        )
    t1, n = edge1 / length[:, None], normal / area[:, None]
    return np.stack([t1, np.cross(n, t1), n], axis=2)
