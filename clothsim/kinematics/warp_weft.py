"""Warp and weft: the two directions in which the threads of a cloth run, in each triangle's own material plane."""

import numpy as np

from clothsim.arrays import Floats
from clothsim.kinematics.deformation_gradient import reference_frames
from clothsim.mesh.cloth import Cloth
from clothsim.mesh.world import World

CLEAR = 0.05
"""By this share an axis must run more with the cloth than an earlier one, to be taken for the warp in its place."""
STEEP = 1e-6
"""Length of an axis's projection on a triangle below which it says nothing of a direction there."""


def thread_axes(world: World, angles: Floats) -> Floats:
    """Unit vectors [a b] of warp and weft as the columns of (m, 2, 2), in the plane of `World.rest_shapes`.

    angles: (m,) from the cloth's first axis to the warp [rad], counter-clockwise about the triangle's normal.
    """
    first = np.concatenate([_first_axes(cloth) for cloth in world.cloths])
    cosine, sine = np.cos(angles), np.sin(angles)
    warp = np.column_stack([cosine * first[:, 0] - sine * first[:, 1], sine * first[:, 0] + cosine * first[:, 1]])
    return np.stack([warp, np.column_stack([-warp[:, 1], warp[:, 0]])], axis=2)


def _first_axes(cloth: Cloth) -> Floats:
    """The cloth's first axis in each triangle's plane, (m, 2).

    With a flat pattern that is the first texture axis, as panels are cut. Else it is the axis x, y or z of the rest
    shape that most of the cloth runs along (x for a flat sheet, the long axis of a tube or a garment), projected; on a
    triangle at right angles to it the next one.
    """
    if cloth.flat:
        return np.tile([1.0, 0.0], (len(cloth.triangles), 1))
    frames = reference_frames(cloth.rest_positions, cloth.triangles)[:, :, :2]
    sizes = np.abs(np.linalg.det(cloth.material_coordinates[:, 1:] - cloth.material_coordinates[:, :1]))
    along = (sizes[:, None] * (frames**2).sum(axis=2)).sum(axis=0) / sizes.sum()
    main = int(np.argmax(along >= along.max() - CLEAR))
    projected = frames[:, main]
    steep = np.linalg.norm(projected, axis=1) < STEEP
    projected = np.where(steep[:, None], frames[:, (main + 1) % 3], projected)
    return np.asarray(projected / np.linalg.norm(projected, axis=1, keepdims=True), np.float64)
