"""Warp and weft: the two thread directions of a cloth in the material plane of each triangle."""

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.geometry.kinematics.deformation_gradient import reference_frames
from clothsim.mesh.cloth import Cloth
from clothsim.mesh.world import World

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
    first = np.concatenate([_first_axes(cloth) for cloth in world.cloths])
    cosine, sine = np.cos(angles), np.sin(angles)
    warp = np.column_stack([cosine * first[:, 0] - sine * first[:, 1], sine * first[:, 0] + cosine * first[:, 1]])
    return np.stack([warp, np.column_stack([-warp[:, 1], warp[:, 0]])], axis=2)


def _first_axes(cloth: Cloth) -> Floats:
    """The cloth's first axis in each triangle's plane, (m, 2).

    With a flat pattern that is the first texture axis, as panels are cut. Else it is the axis x, y or z of the rest
    shape with which most of the cloth's area is aligned (x for a flat sheet, the long axis of a tube or a garment),
    projected; on a triangle perpendicular to it, the next axis.
    """
    if cloth.flat:
        return np.tile([1.0, 0.0], (len(cloth.triangles), 1))
    frames = reference_frames(cloth.rest_positions, cloth.triangles)[:, :, :2]
    areas = np.abs(np.linalg.det(cloth.material_coordinates[:, 1:] - cloth.material_coordinates[:, :1]))
    alignment = (areas[:, None] * (frames**2).sum(axis=2)).sum(axis=0) / areas.sum()
    axis = int(np.argmax(alignment >= alignment.max() - DOMINANCE))
    projected = frames[:, axis]
    perpendicular = np.linalg.norm(projected, axis=1) < MIN_PROJECTION
    projected = np.where(perpendicular[:, None], frames[:, (axis + 1) % 3], projected)
    return np.asarray(projected / np.linalg.norm(projected, axis=1, keepdims=True), np.float64)
