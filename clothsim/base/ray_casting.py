"""Ray casting with embree: the first triangle that a ray meets."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import MissingPackageError


def caster_over(corners: Floats) -> Any:
    """Embree's ray caster over triangles (m, 3, 3).

    MissingPackageError: without embreex.
    """
    try:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene
    except ImportError as error:
        raise MissingPackageError(
            "Ray casting, outlines and woven fabric need embreex, which is not installed.",
            'Run: pip install embreex, or use the renderer "vtk" with the style "fields".',
        ) from error
    scene, vertices = EmbreeScene(), corners.reshape(-1, 3).astype(np.float32)
    TriangleMesh(scene, vertices, np.arange(len(vertices), dtype=np.int32).reshape(-1, 3))
    return scene


@dataclass(frozen=True)
class Hits:
    """First triangles that rays meet.

    Parameters
    ----------
    triangle : (k,) int64
        Its number; -1: none.
    distance : (k,) float64
        Along the ray [m]; inf: none.
    weights : (k, 3) float64
        Barycentric coordinates in the triangle.
    """

    triangle: Ints
    distance: Floats
    weights: Floats


def first_hits(corners: Floats, eye: Floats, rays: Floats) -> Hits:
    """Cast rays (k, 3) from one eye (3,) [m] at triangles (m, 3, 3) [m]; single precision, relative to their size.

    MissingPackageError: without embreex.

    Examples
    --------
    >>> triangle = np.array([[[0.0, 0, 2], [1, 0, 2], [0, 1, 2]]])
    >>> hits = first_hits(triangle, np.zeros(3), np.array([[0.1, 0.2, 2.0], [-1, 0, 2]]))
    >>> hits.triangle.tolist(), hits.weights[0].round(6).tolist()
    ([0, -1], [0.7, 0.1, 0.2])
    """
    units = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    if not len(corners) or not len(rays):
        return Hits(np.full(len(rays), -1), np.full(len(rays), np.inf), np.zeros((len(rays), 3)))
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    middle, scale = 0.5 * (low + high), 1.0 / (float((high - low).max()) or 1.0)
    eyes = np.ascontiguousarray(np.broadcast_to(((eye - middle) * scale).astype(np.float32), units.shape))
    met = caster_over((corners - middle) * scale).run(eyes, units.astype(np.float32), output=True)
    triangle = met["primID"].astype(np.int64)
    u, v = met["u"].astype(np.float64), met["v"].astype(np.float64)
    return Hits(
        triangle,
        np.where(triangle >= 0, met["tfar"] / scale, np.inf),
        np.column_stack([1.0 - u - v, u, v]),
    )
