"""Ray-cast pictures (embree): smooth normals, soft key light, ambient occlusion; no graphics library needed.

Every pixel holds samples x samples primary rays. Each sample then sends one ray to the key light and a few to the sky,
in one of 16 patterns that fill a 4 x 4 block; a mean over alike neighbours turns the patterns into soft shade.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import MissingPackageError
from clothsim.render.camera import Camera, seen_box
from clothsim.render.shading import (
    SKY_RAYS,
    camera_rays,
    light_rays,
    mean_of_alike,
    shaded,
    spread_hemisphere,
    surface_at,
)
from clothsim.render.surface_look import Look

Ray = tuple[float, float, float]
_BAND = 48
_HALO = 4
_SKY_DISTANCE = 0.5


@dataclass(frozen=True)
class _Stage:
    """All triangles, scaled so that what is seen has size 1, the ray caster over them, and where eye and lights are.

    to_key: (3, 3) towards the key light and two directions across it; directions: up, to the key, to the fill light.
    """

    look: Look
    caster: Any
    eye: Floats
    axes: Floats
    tangents: Floats
    to_key: Floats
    directions: tuple[Ray, Ray, Ray]


def render(made: Sequence[Look], camera: Camera, size: tuple[int, int], up: Floats, samples: int = 2) -> Floats:
    """Rendered image, (height, width, 4): sRGB times coverage, and the coverage."""
    width, height = size
    stage = _stage(made, camera, up)
    low, high = _pixel_box(np.concatenate([look.corners for look in made]).reshape(-1, 3), camera, size)
    image = np.zeros((height, width, 4))
    columns = slice(int(low[0]), int(high[0]))
    for top in range(height - int(high[1]), height - int(low[1]), _BAND):
        rows = slice(top, min(top + _BAND, height - int(low[1])))
        if columns.start < columns.stop:
            image[rows, columns] = _band(stage, size, rows, columns, samples)
    return image


def _pixel_box(points: Floats, camera: Camera, size: tuple[int, int]) -> tuple[Ints, Ints]:
    """First and last + 1 pixel, right and upwards, that the points can cover; all where some are behind the camera."""
    if ((points - camera.position) @ camera.axes[2] >= 0).any():
        return np.zeros(2, np.int64), np.array(size)
    pixels = (np.clip(camera.project(points), -2, 2) + 1) / 2 * size
    low, high = np.floor(pixels.min(axis=0)) - 1, np.ceil(pixels.max(axis=0)) + 1
    return np.clip(low, 0, size).astype(np.int64), np.clip(high, 0, size).astype(np.int64)


def _stage(made: Sequence[Look], camera: Camera, up: Floats) -> _Stage:
    try:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene
    except ImportError as error:
        raise MissingPackageError("Drawing by ray casting needs embreex.", "Run: pip install embreex") from error
    joined = Look(*(np.concatenate([getattr(look, field.name) for look in made]) for field in fields(Look)))
    low, high = seen_box(joined.corners.reshape(-1, 3), camera)
    scale = 1.0 / (float((high - low).max()) or 1.0)
    corners = (joined.corners - 0.5 * (low + high)) * scale
    caster = EmbreeScene()
    vertices = corners.reshape(-1, 3).astype(np.float32)
    TriangleMesh(caster, vertices, np.arange(len(vertices), dtype=np.int32).reshape(-1, 3))
    vertical = up / np.linalg.norm(up)
    right, _, backward = camera.axes
    to_key = _unit(0.85 * vertical + 0.40 * backward - 0.70 * right)
    side = _unit(np.cross(to_key, vertical + 0.1 * right))
    return _Stage(
        Look(corners, joined.normals, joined.front, joined.back),
        caster,
        (camera.position - 0.5 * (low + high)) * scale,
        camera.axes,
        camera.tangents,
        np.array([to_key, side, np.cross(to_key, side)]),
        (_numbers(vertical), _numbers(to_key), _numbers(_unit(0.15 * vertical + 0.6 * backward + 0.8 * right))),
    )


def _band(stage: _Stage, size: tuple[int, int], rows: slice, columns: slice, samples: int) -> Floats:
    """The pixels of `rows` and `columns`, (rows, columns, 4); a halo of samples keeps the soft shade seamless."""
    width, height = size[0] * samples, size[1] * samples
    top, bottom = max(0, rows.start * samples - _HALO), min(height, rows.stop * samples + _HALO)
    left, right = columns.start * samples, columns.stop * samples
    rays = camera_rays(stage.axes, stage.tangents, width, height, left, right, top, bottom)
    eyes = np.broadcast_to(stage.eye.astype(np.float32), rays.shape)
    met = stage.caster.run(np.ascontiguousarray(eyes), rays, output=True)
    hits = np.flatnonzero(met["primID"] >= 0)
    shape = (bottom - top, right - left)
    image = np.zeros((shape[0] * shape[1], 4), np.float32)
    if len(hits):
        look = stage.look
        points, smooth, paint = surface_at(
            hits, met["primID"], met["u"], met["v"], rays, look.corners, look.normals, look.front, look.back
        )
        guide = np.zeros((*shape, 4), np.float32)
        guide.reshape(-1, 4)[hits] = np.column_stack([smooth, met["tfar"][hits]])
        pattern = ((hits // shape[1] + top) % 4) * 4 + (hits % shape[1] + left) % 4
        light = np.zeros((*shape, 2), np.float32)
        light.reshape(-1, 2)[hits] = _free_light(stage, points, smooth, pattern)
        light = mean_of_alike(light, guide).reshape(-1, 2)
        image[hits, :3] = shaded(hits, light, smooth, paint, rays, *stage.directions)
        image[hits, 3] = 1.0
    inner = image.reshape(*shape, 4)[rows.start * samples - top : rows.stop * samples - top]
    return inner.reshape(rows.stop - rows.start, samples, columns.stop - columns.start, samples, 4).mean(axis=(1, 3))


def _free_light(stage: _Stage, origins: Floats, smooth: Floats, pattern: Ints) -> Floats:
    """Fraction of the key light and of the near sky that each hit sees, (k, 2)."""
    directions = light_rays(smooth, pattern, stage.to_key, _HEMISPHERE, _DISC)

    def free(towards, distance):
        limits = np.full(len(origins), distance, np.float32)
        return stage.caster.run(origins, towards, dists=limits, query="OCCLUDED") < 0

    sky = np.mean([free(towards, _SKY_DISTANCE) for towards in directions[1:]], axis=0)
    return np.column_stack([free(directions[0], 10.0), sky])


def _numbers(vector: Floats) -> Ray:
    return float(vector[0]), float(vector[1]), float(vector[2])


def _unit(vector: Floats) -> Floats:
    return vector / np.linalg.norm(vector)


_HEMISPHERE = spread_hemisphere(16 * SKY_RAYS)
_DISC = spread_hemisphere(16)[:, :2].copy()
