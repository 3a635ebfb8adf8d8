"""Background of a picture: light gradient, and soft shadow on an invisible floor."""

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.render.camera import Camera

_TOP, _BOTTOM = np.array([0.975, 0.977, 0.98]), np.array([0.90, 0.905, 0.915])
_TEXELS = 320
_PAD = 0.55
_BANDS = ((0.06, 0.012, 0.18), (0.2, 0.03, 0.16), (0.5, 0.06, 0.14), (np.inf, 0.11, 0.14))
"""Height below which a triangle counts, blur, darkness; the first two relative to the scene's size: higher things blur
more. Each stencil holds those of the ones before it, or the floor between them would be bright: rings under a ball."""


def backdrop(triangles: Floats, camera: Camera, size: tuple[int, int], up: Floats) -> Floats:
    """The picture behind the `triangles` (m, 3, 3) [m], sRGB in [0, 1], (height, width, 3)."""
    width, height = size
    down = np.linspace(0, 1, height)[:, None, None]
    gradient = np.broadcast_to(_TOP + (_BOTTOM - _TOP) * down**1.5, (height, width, 3))
    return gradient * _floor_light(triangles, camera, size, up)[:, :, None]


def _floor_light(triangles: Floats, camera: Camera, size: tuple[int, int], up: Floats) -> Floats:
    """Unoccluded fraction of light on the floor seen through each pixel, (height, width); 1 where none is seen."""
    from scipy.ndimage import map_coordinates

    vertical = up / np.linalg.norm(up)
    sideways = np.cross(vertical, np.roll(vertical, 1))
    sideways /= np.linalg.norm(sideways)
    plane = np.array([sideways, np.cross(vertical, sideways)])
    heights = triangles @ vertical
    floor = heights.min()
    flat = triangles @ plane.T
    low, high = flat.min(axis=(0, 1)), flat.max(axis=(0, 1))
    extent = float((high - low).max()) or 1.0
    origin = 0.5 * (low + high) - (0.5 + _PAD) * extent
    per_texel = (1 + 2 * _PAD) * extent / _TEXELS
    texture = _shadow_texture((flat - origin) / per_texel, (heights.mean(axis=1) - floor) / extent, extent / per_texel)

    rays = camera.directions(*size)
    fall = -(rays @ vertical)
    above = float(camera.position @ vertical - floor)
    if above <= 0:
        return np.ones(fall.shape)
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = np.where(fall > 1e-6, above / fall, 0.0)
    on_plane = (camera.position @ plane.T + distance[:, :, None] * (rays @ plane.T) - origin) / per_texel - 0.5
    light = map_coordinates(texture, [on_plane[:, :, 1], on_plane[:, :, 0]], order=1, mode="constant", cval=1.0)
    return np.where(fall > 1e-6, light, 1.0)


def _shadow_texture(flat: Floats, heights: Floats, texels_per_size: float) -> Floats:
    """Light on the floor from straight above, (texels, texels): one blurred stencil for each band of height."""
    from PIL import Image, ImageDraw, ImageFilter

    light = np.ones((_TEXELS, _TEXELS))
    for end, blur, dark in _BANDS:
        stencil = Image.new("L", (_TEXELS, _TEXELS), 0)
        pen = ImageDraw.Draw(stencil)
        for corners in flat[heights < end].reshape(-1, 6).tolist():
            pen.polygon(corners, fill=255)
        soft = stencil.filter(ImageFilter.GaussianBlur(blur * texels_per_size))
        light *= 1 - dark * np.asarray(soft, float) / 255
    return light
