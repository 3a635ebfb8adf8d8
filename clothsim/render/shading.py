"""Per-sample kernels of the ray caster: camera rays, the surface at a hit, rays towards light, and the light model.

Band arrays are (rows, columns, ...) of samples; `hits (k,)` are the flat indices in the band that met a triangle.
"""

import numpy as np

from clothsim.base.jit import kernel, part

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
def _minus(a, b):
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@part
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@part
def _cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@part
def _unit(a):
    length = max(np.sqrt(_dot(a, a)), 1e-300)
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
        normal = _unit(_cross(_minus(_row(corners[t], 1), start), _minus(_row(corners[t], 2), start)))
        behind = _dot(normal, _row(rays, h)) > 0
        side = -1.0 if behind else 1.0
        colours = back[t] if behind else front[t]
        flat = _mean(corners[t], weights)
        _store(points, n, 1.0, flat)
        for corner in range(3):
            bulge = side * _dot(_minus(_row(corners[t], corner), flat), _row(normals[t], corner))
            for k in range(3):
                points[n, k] += weights[corner] * max(bulge, 0.0) * side * normals[t, corner, k]
        for k in range(3):
            points[n, k] += _OFFSET * side * normal[k]
        _store(smooth, n, side, _unit(_mean(normals[t], weights)))
        _store(paint, n, 1.0, _mean(colours, weights))
    return points, smooth, paint


@kernel
def light_rays(smooth, pattern, to_key, hemisphere, disc):
    """Directions (1 + SKY_RAYS, k, 3) from each hit: one to the key light, the rest to the sky."""
    directions = np.empty((1 + SKY_RAYS, len(smooth), 3), np.float32)
    for n in range(len(smooth)):
        normal = _row(smooth, n)
        tangent = _unit(_cross(normal, (0.0, 1.0, 0.0) if abs(normal[0]) > 0.7 else (1.0, 0.0, 0.0)))
        bitangent = _cross(normal, tangent)
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
        lambert = max(_dot(normal, to_key), 0.0) * key
        fill = (0.5 + 0.5 * _dot(normal, to_fill)) ** 2 * (0.4 + 0.6 * sky)
        upward = 0.5 + 0.5 * _dot(normal, up)
        towards_eye = min(max(-_dot(normal, _row(rays, h)), 0.0), 1.0)
        rim = 0.04 * (1 - towards_eye) ** 4 * sky
        for k in range(3):
            ambient = (upward * _SKY[k] + (1 - upward) * _GROUND[k]) * (0.10 + 0.90 * sky)
            linear = paint[n, k] ** 2.2 * (_KEY[k] * lambert + _FILL[k] * fill + ambient) + rim
            out[n, k] = _rolled_off(linear) ** (1 / 2.2)
    return out


@part
def _rolled_off(linear):
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
