"""Ray casting (embree): what each sample of a picture sees, and pictures with soft light that need no graphics library.

Every pixel holds samples x samples primary rays. Each sample then sends one ray to the key light and a few to the sky,
in one of 16 patterns that fill a 4 x 4 block; a mean over alike neighbours turns the patterns into soft shade.

Band arrays are (rows, columns, ...) of samples; `hits (k,)` are the flat indices in the band that met a triangle.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.jit import kernel, part
from clothsim.base.linalg import unit
from clothsim.base.ray_casting import caster_over
from clothsim.base.triangles import vertex_normals
from clothsim.base.vectors import cross, dot, minus
from clothsim.render.camera import Viewpoint, seen_box
from clothsim.render.surface_look import Look, Surface


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


def pixel_geometry(surfaces: Sequence[Surface], camera: Viewpoint, size: tuple[int, int]) -> PixelGeometry:
    """Cast one ray through the middle of each pixel of `size` (width, height).

    MissingPackageError: without embreex.
    """
    triangles = np.concatenate([each.triangles for each in surfaces])
    owner = np.repeat(np.arange(len(surfaces)), [len(each.triangles) for each in surfaces])
    starts = np.cumsum([0, *(len(each.positions) for each in surfaces)])
    triangles = triangles + starts[owner][:, None]
    x = np.concatenate([each.positions for each in surfaces])
    material = np.concatenate([each.material if len(each.material) else each.positions for each in surfaces])
    # first hit of the ray through each pixel
    low, high = seen_box(x[triangles].reshape(-1, 3), camera)
    scale = 1.0 / (float((high - low).max()) or 1.0)  # embree computes in single precision
    scene = caster_over((x[triangles] - 0.5 * (low + high)) * scale)
    rays = camera.directions(*size).reshape(-1, 3)
    rays = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    eye = ((camera.position - 0.5 * (low + high)) * scale).astype(np.float32)
    eyes = np.ascontiguousarray(np.broadcast_to(eye, rays.shape))
    met = scene.run(eyes, rays.astype(np.float32), output=True)
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


def render(made: Sequence[Look], camera: Viewpoint, size: tuple[int, int], up: Floats, samples: int = 2) -> Floats:
    """Rendered image, (height, width, 4): sRGB times coverage, and the coverage."""
    width, height = size
    stage = _stage(made, camera, up)
    points = np.concatenate([look.corners for look in made]).reshape(-1, 3)
    # first and last + 1 pixel, right and upwards, that the points can cover; all where some are behind the camera
    if ((points - camera.position) @ camera.axes[2] >= 0).any():
        low, high = np.zeros(2, np.int64), np.array(size)
    else:
        pixels = (np.clip(camera.project(points), -2, 2) + 1) / 2 * size
        low, high = np.floor(pixels.min(axis=0)) - 1, np.ceil(pixels.max(axis=0)) + 1
        low, high = np.clip(low, 0, size).astype(np.int64), np.clip(high, 0, size).astype(np.int64)
    image = np.zeros((height, width, 4))
    columns = slice(int(low[0]), int(high[0]))
    for top in range(height - int(high[1]), height - int(low[1]), _BAND):
        rows = slice(top, min(top + _BAND, height - int(low[1])))
        if columns.start < columns.stop:
            image[rows, columns] = _band(stage, size, rows, columns, samples)
    return image


def _stage(made: Sequence[Look], camera: Viewpoint, up: Floats) -> _Stage:
    joined = Look(*(np.concatenate([getattr(look, field.name) for look in made]) for field in fields(Look)))
    low, high = seen_box(joined.corners.reshape(-1, 3), camera)
    scale = 1.0 / (float((high - low).max()) or 1.0)
    corners = (joined.corners - 0.5 * (low + high)) * scale
    vertical = up / np.linalg.norm(up)
    right, _, backward = camera.axes
    to_key = unit(0.85 * vertical + 0.40 * backward - 0.70 * right)
    side = unit(np.cross(to_key, vertical + 0.1 * right))
    return _Stage(
        Look(corners, joined.normals, joined.front, joined.back),
        caster_over(corners),
        (camera.position - 0.5 * (low + high)) * scale,
        camera.axes,
        camera.tangents,
        np.array([to_key, side, np.cross(to_key, side)]),
        (_numbers(vertical), _numbers(to_key), _numbers(unit(0.15 * vertical + 0.6 * backward + 0.8 * right))),
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


SKY_RAYS = 2
_SUN_RADIUS = 0.12
_OFFSET = 3e-4
_KEY = (0.82, 0.79, 0.75)
_FILL = (0.12, 0.13, 0.15)
_SKY = (0.40, 0.41, 0.43)
_GROUND = (0.22, 0.215, 0.21)


@part
def _row(rows, i):
    return float(rows[i, 0]), float(rows[i, 1]), float(rows[i, 2])


@part
def _store(rows, i, factor, vector):
    for k in range(3):
        rows[i, k] = factor * vector[k]


@part
def _mean(corners, weights):
    a, b, c = weights
    x = a * corners[0, 0] + b * corners[1, 0] + c * corners[2, 0]
    y = a * corners[0, 1] + b * corners[1, 1] + c * corners[2, 1]
    z = a * corners[0, 2] + b * corners[1, 2] + c * corners[2, 2]
    return x, y, z


@part
def _unit_part(a):
    length = max(np.sqrt(dot(a, a)), 1e-300)
    return a[0] / length, a[1] / length, a[2] / length


@kernel
def camera_rays(axes, tangents, width, height, left, right, top, bottom):
    """Unit directions through the samples of columns left..right-1 and rows top..bottom-1, (rows * columns, 3)."""
    out = np.empty(((bottom - top) * (right - left), 3), np.float32)
    row = 0
    for i in range(top, bottom):
        y = (1 - (i + 0.5) / height * 2) * tangents[1]
        for j in range(left, right):
            x = ((j + 0.5) / width * 2 - 1) * tangents[0]
            length = np.sqrt(x * x + y * y + 1)
            for k in range(3):
                out[row, k] = (x * axes[0, k] + y * axes[1, k] - axes[2, k]) / length
            row += 1
    return out


@kernel
def surface_at(hits, triangle, u, v, rays, corners, normals, front, back):
    """Origins of light rays, the interpolated normal facing the camera, and the sRGB of the side seen, each (k, 3).

    They start above the triangle, on the curved surface that its corner normals n_i suggest, or the facets would shade
    one another near the terminator: p + sum_i w_i max(0, (v_i - p) . n_i) n_i (Hanika 2021, Hacking the shadow
    terminator, Ray Tracing Gems II), and a little further out.
    """
    points = np.empty((len(hits), 3), np.float32)
    smooth, paint = np.empty_like(points), np.empty_like(points)
    for n in range(len(hits)):
        h = hits[n]
        t = triangle[h]
        weights = (1.0 - u[h] - v[h], np.float64(u[h]), np.float64(v[h]))
        start = _row(corners[t], 0)
        normal = _unit_part(cross(minus(_row(corners[t], 1), start), minus(_row(corners[t], 2), start)))
        behind = dot(normal, _row(rays, h)) > 0
        side = -1.0 if behind else 1.0
        colours = back[t] if behind else front[t]
        flat = _mean(corners[t], weights)
        _store(points, n, 1.0, flat)
        for corner in range(3):
            bulge = side * dot(minus(_row(corners[t], corner), flat), _row(normals[t], corner))
            for k in range(3):
                points[n, k] += weights[corner] * max(bulge, 0.0) * side * normals[t, corner, k]
        for k in range(3):
            points[n, k] += _OFFSET * side * normal[k]
        _store(smooth, n, side, _unit_part(_mean(normals[t], weights)))
        _store(paint, n, 1.0, _mean(colours, weights))
    return points, smooth, paint


@kernel
def light_rays(smooth, pattern, to_key, hemisphere, disc):
    """Directions (1 + SKY_RAYS, k, 3) from each hit: one to the key light, the rest to the sky."""
    directions = np.empty((1 + SKY_RAYS, len(smooth), 3), np.float32)
    for n in range(len(smooth)):
        normal = _row(smooth, n)
        tangent = _unit_part(cross(normal, (0.0, 1.0, 0.0) if abs(normal[0]) > 0.7 else (1.0, 0.0, 0.0)))
        bitangent = cross(normal, tangent)
        p = pattern[n]
        for k in range(3):
            directions[0, n, k] = to_key[0, k] + _SUN_RADIUS * (disc[p, 0] * to_key[1, k] + disc[p, 1] * to_key[2, k])
            for s in range(SKY_RAYS):
                x, y, z = _row(hemisphere, p * SKY_RAYS + s)
                directions[1 + s, n, k] = x * tangent[k] + y * bitangent[k] + z * normal[k]
    return directions


@kernel
def mean_of_alike(light, guide):
    """Mean of each sample's light over the 8 x 8 samples around it whose normal and depth are close to its own.

    guide: (rows, columns, 4) normal and depth, depth 0 where nothing was hit.
    """
    rows, columns, n = light.shape
    out = np.zeros_like(light)
    for i in range(rows):
        for j in range(columns):
            x, y, z, depth = guide[i, j]
            if depth == 0.0:
                continue
            total = 0.0
            for p in range(max(0, i - 4), min(rows, i + 4)):
                for q in range(max(0, j - 4), min(columns, j + 4)):
                    alike = x * guide[p, q, 0] + y * guide[p, q, 1] + z * guide[p, q, 2]
                    if alike > 0.9 and abs(guide[p, q, 3] - depth) < 0.01 * depth:
                        total += 1.0
                        for k in range(n):
                            out[i, j, k] += light[p, q, k]
            for k in range(n):
                out[i, j, k] /= total
    return out


@kernel
def shaded(hits, light, smooth, paint, rays, up, to_key, to_fill):
    """sRGB of each hit, (k, 3): colour x (key light in soft shadow + weak fill + sky and ground under occlusion).

    light: (samples, 2) unoccluded fractions of the key light and of the sky; up, to_key, to_fill: three numbers
    each. A faint rim keeps outlines readable.
    """
    out = np.empty((len(hits), 3), np.float32)
    for n in range(len(hits)):
        h = hits[n]
        normal = _row(smooth, n)
        key, sky = light[h, 0], light[h, 1]
        lambert = max(dot(normal, to_key), 0.0) * key
        fill = (0.5 + 0.5 * dot(normal, to_fill)) ** 2 * (0.4 + 0.6 * sky)
        upward = 0.5 + 0.5 * dot(normal, up)
        towards_eye = min(max(-dot(normal, _row(rays, h)), 0.0), 1.0)
        rim = 0.04 * (1 - towards_eye) ** 4 * sky
        for k in range(3):
            ambient = (upward * _SKY[k] + (1 - upward) * _GROUND[k]) * (0.10 + 0.90 * sky)
            linear = paint[n, k] ** 2.2 * (_KEY[k] * lambert + _FILL[k] * fill + ambient) + rim
            out[n, k] = _compress_highlights(linear) ** (1 / 2.2)
    return out


@part
def _compress_highlights(linear):
    """Smooth compression of the brightest fifth, without hard clipping."""
    if linear <= 0.8:
        return linear
    return 0.8 + 0.2 * (1 - np.exp(-(linear - 0.8) / 0.2))


def spread_hemisphere(count: int) -> np.ndarray:
    """`count` cosine-weighted directions about z, (count, 3): the R2 sequence (Roberts 2018) in a fixed shuffle."""
    k = np.arange(1, count + 1)[:, None]
    points = (0.5 + k * np.array([0.7548776662466927, 0.5698402909980532])) % 1.0
    points = np.random.default_rng(7).permutation(points)
    radius, turn = np.sqrt(points[:, 0]), 2 * np.pi * points[:, 1]
    return np.column_stack([radius * np.cos(turn), radius * np.sin(turn), np.sqrt(1 - radius**2)])


_HEMISPHERE = spread_hemisphere(16 * SKY_RAYS)
_DISC = spread_hemisphere(16)[:, :2].copy()
