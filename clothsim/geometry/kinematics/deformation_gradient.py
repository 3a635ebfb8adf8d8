"""Deformation gradient F (3x2) of each triangle, its area ratio and its material frame."""

import numpy as np
from numpy.typing import NDArray

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.mesh.cloth import Cloth
from clothsim.mesh.world import World


def deformation_gradients(
    positions: NDArray[np.floating], triangles: Ints, rest_shape_inverses: NDArray[np.floating]
) -> NDArray[np.floating]:
    """Deformation gradient F = [x1 - x0, x2 - x0] Dm^-1 of each triangle: material plane to space.

    Parameters
    ----------
    positions : (n, 3) array
        Vertex positions [m].
    triangles : (m, 3) int array
        Vertex rows of each triangle.
    rest_shape_inverses : (m, 2, 2) array
        Dm^-1 [1/m], where the columns of Dm are the two edges at vertex 0 in the material plane, as of
        `World.rest_shape_inverses`.

    Returns
    -------
    (m, 3, 2) array
        F, dimensionless; float32 if both arrays are.

    Examples
    --------
    A right triangle stretched to twice its length along x:

    >>> import numpy as np
    >>> positions = np.array([[0.0, 0, 0], [2, 0, 0], [0, 1, 0]])
    >>> deformation_gradients(positions, np.array([[0, 1, 2]]), np.eye(2)[None])
    array([[[2., 0.],
            [0., 1.],
            [0., 0.]]])
    """
    corners = positions[triangles]
    edges = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=2)
    return edges @ rest_shape_inverses


def area_ratios(F: NDArray[np.floating]) -> NDArray[np.floating]:
    """Area ratio J = |f1 x f2| = l1 l2 of each deformation gradient: deformed over rest area.

    Parameters
    ----------
    F : (..., 3, 2) array
        Deformation gradients.

    Returns
    -------
    (...) array
        J >= 0, dimensionless.

    Examples
    --------
    >>> import numpy as np
    >>> float(area_ratios(np.array([[2.0, 0], [0, 3], [0, 0]])))
    6.0
    """
    return np.linalg.norm(np.cross(F[..., 0], F[..., 1]), axis=-1)


def reference_frames(rest_positions: Floats, triangles: Ints) -> Floats:
    """Orthonormal frame t1, t2, n of each triangle, the axes of the material plane of a cloth without a flat pattern.

    t1 = e1/|e1|, n = e1 x e2/|e1 x e2|, t2 = n x t1. The columns [t1 t2] map a material direction to the space of the
    rest positions; for a deformed shape the same is R of `stretch.polar_decomposition`.

    Parameters
    ----------
    rest_positions : (n, 3) array
        Vertex positions at rest [m].
    triangles : (m, 3) int array
        Vertex rows of each triangle.

    Returns
    -------
    (m, 3, 3) array
        Rotations with the columns t1, t2, n.

    Raises
    ------
    InputError
        A triangle has no area; names the first.

    Examples
    --------
    >>> import numpy as np
    >>> positions = np.array([[0.0, 0, 0], [0, 2, 0], [-1, 0, 0]])
    >>> reference_frames(positions, np.array([[0, 1, 2]]))[0][:, 0]
    array([0., 1., 0.])
    """
    corners = rest_positions[triangles]
    edge1, edge2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(edge1, edge2)
    length, area = np.linalg.norm(edge1, axis=1), np.linalg.norm(normal, axis=1)
    bad = np.flatnonzero(~(area > 0))  # NaN is refused too
    if bad.size:
        raise InputError(
            f"triangle {bad[0]} has no area, so it has no frame ({bad.size} such triangles).",
            "Remove it or merge its vertices.",
        )
    t1, n = edge1 / length[:, None], normal / area[:, None]
    return np.stack([t1, np.cross(n, t1), n], axis=2)


# Warp and weft, the two thread directions of a cloth in the material plane of each triangle.


DOMINANCE = 0.05
"""Difference of alignment by which a later axis must exceed an earlier one to be chosen as the warp instead."""
MIN_PROJECTION = 1e-6
"""Length of an axis's projection on a triangle below which its direction there is undetermined."""


def thread_axes(world: World, angles: Floats) -> Floats:
    """Warp and weft directions in the material plane of each triangle.

    Parameters
    ----------
    world : World
        Cloths in their rest shapes.
    angles : (m,) array
        Angle from the cloth's first axis to the warp [rad], counter-clockwise about the triangle's normal.

    Returns
    -------
    (m, 2, 2) array
        Unit vectors of warp and weft as columns, in the plane of `World.rest_shapes`.
    """
    first = np.concatenate([np.zeros((0, 2)), *(_first_axes(cloth) for cloth in world.cloths)])
    cosine, sine = np.cos(angles), np.sin(angles)
    warp = np.column_stack([cosine * first[:, 0] - sine * first[:, 1], sine * first[:, 0] + cosine * first[:, 1]])
    return np.stack([warp, np.column_stack([-warp[:, 1], warp[:, 0]])], axis=2)


def _first_axes(cloth: Cloth) -> Floats:
    """The cloth's first axis in each triangle's plane, (m, 2).

    With a flat pattern that is the first texture axis, as panels are cut. Else it is the axis x, y or z of the rest
    shape with which most of the cloth's area is aligned (x for a flat sheet, the long axis of a tube or a garment),
    projected; on a triangle perpendicular to it, the next axis.
    """
    if cloth.flat or not len(cloth.triangles):
        return np.tile([1.0, 0.0], (len(cloth.triangles), 1))
    frames = reference_frames(cloth.rest_positions, cloth.triangles)[:, :, :2]
    areas = np.abs(np.linalg.det(cloth.material_coordinates[:, 1:] - cloth.material_coordinates[:, :1]))
    alignment = (areas[:, None] * (frames**2).sum(axis=2)).sum(axis=0) / areas.sum()
    axis = int(np.argmax(alignment >= alignment.max() - DOMINANCE))
    projected = frames[:, axis]
    perpendicular = np.linalg.norm(projected, axis=1) < MIN_PROJECTION
    projected = np.where(perpendicular[:, None], frames[:, (axis + 1) % 3], projected)
    return np.asarray(projected / np.linalg.norm(projected, axis=1, keepdims=True), np.float64)
