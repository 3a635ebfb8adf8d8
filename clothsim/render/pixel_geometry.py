"""Geometry seen by each sample of a picture: surface, point of the material, normal and depth, by ray casting."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import MissingPackageError
from clothsim.render.camera import Camera, seen_box
from clothsim.render.surface_look import Surface, vertex_normals


@dataclass(frozen=True)
class PixelGeometry:
    """What the samples of a picture see, rows from the top.

    Parameters
    ----------
    surface : (h, w) int64
        Number of the surface; -1: none.
    depth : (h, w) float64
        Distance along the ray [m]; inf: none.
    material : (h, w, 3) float64
        Point of the undeformed cloth [m], 0 elsewhere.
    side : (h, w, 3) float64
        Normal of the undeformed cloth there, 0 elsewhere.
    facing : (h, w) float64
        |cosine| between the ray and the surface's smooth normal.
    """

    surface: Ints
    depth: Floats
    material: Floats
    side: Floats
    facing: Floats


def pixel_geometry(surfaces: Sequence[Surface], camera: Camera, size: tuple[int, int]) -> PixelGeometry:
    """Cast one ray through the middle of each pixel of `size` (width, height).

    Raises
    ------
    MissingPackageError
        Without embreex.
    """
    triangles = np.concatenate([each.triangles for each in surfaces])
    owner = np.repeat(np.arange(len(surfaces)), [len(each.triangles) for each in surfaces])
    starts = np.cumsum([0, *(len(each.positions) for each in surfaces)])
    triangles = triangles + starts[owner][:, None]
    x = np.concatenate([each.positions for each in surfaces])
    material = np.concatenate([each.material if len(each.material) else each.positions for each in surfaces])
    met, rays = _cast(x[triangles], camera, size)
    hit = np.flatnonzero(met["primID"] >= 0)
    corners = triangles[met["primID"][hit]]
    u, v = met["u"][hit, None], met["v"][hit, None]

    def seen(values: Floats) -> Floats:
        a, b, c = (values[corners[:, k]] for k in range(3))
        return (1.0 - u - v) * a + u * b + v * c

    n_samples = len(rays)
    surface, depth, facing = np.full(n_samples, -1), np.full(n_samples, np.inf), np.zeros(n_samples)
    point, side = np.zeros((2, n_samples, 3))
    surface[hit] = owner[met["primID"][hit]]
    depth[hit] = np.linalg.norm(seen(x) - camera.position, axis=1)
    normals = seen(vertex_normals(x, triangles))
    facing[hit] = np.abs((normals * rays[hit]).sum(axis=1)) / np.maximum(np.linalg.norm(normals, axis=1), 1e-12)
    point[hit], side[hit] = seen(material), seen(vertex_normals(material, triangles))
    width, height = size
    return PixelGeometry(
        surface.reshape(height, width),
        depth.reshape(height, width),
        point.reshape(height, width, 3),
        side.reshape(height, width, 3),
        facing.reshape(height, width),
    )


def caster_over(corners: Floats) -> Any:
    """Embree's ray caster over triangles (m, 3, 3).

    Raises
    ------
    MissingPackageError
        Without embreex.
    """
    try:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene
    except ImportError as error:
        raise MissingPackageError(
            "Ray casting, outlines and woven fabric need embreex, which is not installed.",
            'Run: pip install embreex, or take the renderer "vtk" with the style "fields".',
        ) from error
    scene, vertices = EmbreeScene(), corners.reshape(-1, 3).astype(np.float32)
    TriangleMesh(scene, vertices, np.arange(len(vertices), dtype=np.int32).reshape(-1, 3))
    return scene


def _cast(corners: Floats, camera: Camera, size: tuple[int, int]) -> tuple[dict[str, Floats], Floats]:
    """First hit of the ray through each pixel, and the unit rays (pixels, 3)."""
    low, high = seen_box(corners.reshape(-1, 3), camera)
    scale = 1.0 / (float((high - low).max()) or 1.0)  # embree computes in single precision
    scene = caster_over((corners - 0.5 * (low + high)) * scale)
    rays = camera.directions(*size).reshape(-1, 3)
    rays = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    eye = ((camera.position - 0.5 * (low + high)) * scale).astype(np.float32)
    eyes = np.ascontiguousarray(np.broadcast_to(eye, rays.shape))
    return scene.run(eyes, rays.astype(np.float32), output=True), rays
