"""Winding of a shape before it is checked: an orientable one whose triangles disagree is rewound, with a note."""

from dataclasses import replace

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.mesh.winding import facing_away, wound
from clothsim.scene.assembly.placement import Shape


def wound_alike(shape: Shape, body: Floats | None = None) -> Shape:
    """A shape whose triangles are wound alike in each component: as most of them, or away from a body (k, 3) [m].

    The material plane of a turned triangle is mirrored with it, which keeps warp and weft.
    """
    triangles, turned = wound(shape.triangles, len(shape.positions))
    if not turned.any():
        return shape
    how = "as most of their piece"
    if body is not None:
        triangles = facing_away(shape.positions, triangles, body, turned)
        how = "away from the body"
    swapped = (triangles != shape.triangles).any(axis=1)
    texture = shape.texture
    if len(texture):
        texture = np.where(swapped[:, None, None], texture[:, [0, 2, 1]] * [1.0, -1.0], texture)
    count, first = np.count_nonzero(swapped), np.flatnonzero(turned)[0]
    note = (
        f"{count} of {len(triangles)} triangles (the first {first}) are rewound {how}: their winding was inconsistent"
    )
    return replace(shape, triangles=triangles, texture=texture, notes=(*shape.notes, note))
