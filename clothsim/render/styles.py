"""Styles of a picture: background with a soft shadow, ink outlines, ribs and sheen of a woven cloth, legend."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from PIL import Image, ImageColor, ImageDraw, ImageFilter, ImageFont

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.base.memo import known_for_arrays
from clothsim.render.camera import Margins, Viewpoint
from clothsim.render.colour_scale import Scale
from clothsim.render.ray_caster import PixelGeometry

_INK = (72, 74, 80)


def margins(size: tuple[int, int], with_bar: bool, title: str) -> Margins:
    """Margins that the legend takes from a picture of `size` (width, height) pixels."""
    em, (width, height) = _em(size), size
    return Margins(right=14 * em / width if with_bar else 0.08, top=max(0.08, 7 * em / height) if title else 0.08)


def add_legend(image: Floats, scale: Scale | None, title: str) -> np.ndarray:
    """`image (h, w, 3)`, sRGB in [0, 1], as uint8 with a title and, unless `scale` is None, its bar."""
    height, width = image.shape[:2]
    canvas = Image.fromarray(np.round(np.clip(image, 0, 1) * 255).astype(np.uint8))
    pen = ImageDraw.Draw(canvas)
    em = _em((width, height))
    if title:
        pen.text((1.6 * em, 1.3 * em), title, fill=_INK, font=ImageFont.load_default(1.25 * em), anchor="la")
    if scale is not None:
        width, height = canvas.size
        tall, wide = round(0.42 * height), max(4, round(0.62 * em))
        left, top = round(width - 5.2 * em), round(0.5 * (height - 0.42 * height) + 0.5 * em)
        values = scale.high - (scale.high - scale.low) * (np.arange(tall) + 0.5) / tall
        column = np.round(scale.colours(values) * 255).astype(np.uint8)
        canvas.paste(
            Image.fromarray(np.ascontiguousarray(np.broadcast_to(column[:, None], (tall, wide, 3)))), (left, top)
        )
        pen = ImageDraw.Draw(canvas)
        font = ImageFont.load_default(em)
        for value, text in scale.ticks:
            y = top + tall * (scale.high - value) / (scale.high - scale.low)
            pen.line((left + wide + 0.2 * em, y, left + wide + 0.5 * em, y), fill=_INK, width=max(1, round(em / 16)))
            pen.text((left + wide + 0.8 * em, y), text, fill=_INK, font=font, anchor="lm")
        for line, text in enumerate(reversed(scale.heading)):
            pen.text((left + 1.1 * em, top - (1.75 + 1.15 * line) * em), text, fill=_INK, font=font, anchor="ma")
    return np.asarray(canvas)


def label(pen: Any, corner: tuple[float, float], text: str, em: float) -> None:
    """Write a line of letters `em` pixels tall, its upper left corner there."""
    pen.text(corner, text, fill=_INK, font=ImageFont.load_default(em), anchor="la")


def _em(size: tuple[int, int]) -> float:
    """The height of the letters in pixels."""
    return max(9.0, min(size) / 48)


@dataclass(frozen=True)
class Style:
    """What a picture adds to its surfaces and leaves out behind them.

    Parameters
    ----------
    colour : str
        Colour of the cloth where none is asked for, as of `picture.draw`.
    paper : bool
        White behind everything; else a light gradient with a soft shadow on the floor.
    body_opacity : float
        1: bodies hide what is behind them.
    outlines : bool
        Ink along borders, silhouettes and folds.
    woven : bool
        Ribs of a twill, fixed to the material, and the sheen of fibres seen at a grazing angle.
    traced : bool
        Light is traced, by `studio.render`; whole figures are in the picture, and no title.
    """

    colour: str = "stretch"
    paper: bool = False
    body_opacity: float = 1.0
    outlines: bool = False
    woven: bool = False
    traced: bool = False

    @property
    def needs_geometry(self) -> bool:
        """True where pixels must know which surface they show."""
        return self.outlines or self.woven


STYLES = {
    "fields": Style(),
    "print": Style(paper=True, body_opacity=0.5, outlines=True),
    "fabric": Style(colour="plain", woven=True),
    "studio": Style(colour="plain", traced=True),
}
"""Styles by name; the first is the default."""


_TOP, _BOTTOM = np.array([0.975, 0.977, 0.98]), np.array([0.90, 0.905, 0.915])
_TEXELS = 320
_PAD = 0.55
_BANDS = ((0.06, 0.012, 0.18), (0.2, 0.03, 0.16), (0.5, 0.06, 0.14), (np.inf, 0.11, 0.14))
"""Height below which a triangle counts, blur, darkness; the first two relative to the scene's size: higher things blur
more. Each stencil holds those of the ones before it, or the floor between them would be bright: rings under a ball."""


def backdrop(triangles: Floats, camera: Viewpoint, size: tuple[int, int], up: Floats) -> Floats:
    """The picture behind the `triangles` (m, 3, 3) [m], sRGB in [0, 1], (height, width, 3)."""
    width, height = size
    down = np.linspace(0, 1, height)[:, None, None]
    gradient = np.broadcast_to(_TOP + (_BOTTOM - _TOP) * down**1.5, (height, width, 3))
    return gradient * _floor_light(triangles, camera, size, up)[:, :, None]


def _floor_light(triangles: Floats, camera: Viewpoint, size: tuple[int, int], up: Floats) -> Floats:
    """Unoccluded fraction of light on the floor seen through each pixel, (height, width); 1 where none is seen."""
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

    def along(direction: Floats) -> Floats:
        """Component of the ray of each pixel along a direction, (height, width)."""
        across, upward, backward = camera.axes @ direction
        return (camera.columns(size[0]) * across)[None] + (camera.rows(size[1]) * upward - backward)[:, None]

    fall = -along(vertical)
    above = float(camera.position @ vertical - floor)
    if above <= 0:
        return np.ones(fall.shape)
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = np.where(fall > 1e-6, above / fall, 0.0)
    start = (camera.position @ plane.T - origin) / per_texel - 0.5
    on_plane = np.stack([start[k] + distance * along(plane[k] / per_texel) for k in range(2)], axis=2)
    inside = (fall > 1e-6) & ((on_plane >= 0.0) & (on_plane <= _TEXELS - 1.0)).all(axis=2)
    light = np.ones(fall.shape)
    at = on_plane[inside]  # column and row, between the middles of the texels at the edges
    corner = np.minimum(at.astype(np.int64), len(texture) - 2)
    (x, y), (column, row) = (at - corner).T, corner.T
    upper = (1.0 - x) * texture[row, column] + x * texture[row, column + 1]
    lower = (1.0 - x) * texture[row + 1, column] + x * texture[row + 1, column + 1]
    light[inside] = (1.0 - y) * upper + y * lower
    return light


@known_for_arrays  # front and back views of one scene have the same floor
def _shadow_texture(flat: Floats, heights: Floats, texels_per_size: float) -> Floats:
    """Light on the floor from straight above, (texels, texels): one blurred stencil for each band of height.

    Corners count by their texel, and what most triangles of a fine body cover has been drawn for another one.
    """
    light, begin = np.ones((_TEXELS, _TEXELS)), -np.inf
    stencil = Image.new("L", (_TEXELS, _TEXELS), 0)
    pen = ImageDraw.Draw(stencil)
    texels = flat.astype(np.int64)
    keys = np.sort(texels @ (1, _TEXELS), axis=1) @ _TEXELS ** np.arange(0, 6, 2)  # in any order of the corners
    for end, blur, dark in _BANDS:
        within = np.flatnonzero((heights >= begin) & (heights < end))
        for corners in texels[within[np.unique(keys[within], return_index=True)[1]]].reshape(-1, 6).tolist():
            pen.polygon(corners, fill=255)
        soft = stencil.filter(ImageFilter.GaussianBlur(blur * texels_per_size))
        light *= 1 - dark * np.asarray(soft, float) / 255
        begin = end
    return light


INK = np.array([0.13, 0.14, 0.17])
JUMP = 0.012
"""Second difference of the depth over the median depth from which on one sheet hides another: a fold seen from its
side has none, two layers 1 cm apart at a metre's distance do."""


def outlined(image: Floats, geometry: PixelGeometry, samples: int) -> Floats:
    """Return the picture (h, w, 3), sRGB, with outlines; geometry: of its samples."""
    height, width = geometry.surface.shape
    edge = np.zeros((height, width), bool)
    seen = np.isfinite(geometry.depth)
    far = float(np.median(geometry.depth[seen])) if seen.any() else 1.0
    depth = np.where(seen, geometry.depth, 10.0 * far)
    _mark(edge, geometry.surface, depth, JUMP * far)
    _mark(edge.T, geometry.surface.T, depth.T, JUMP * far)
    parts = edge.reshape(height // samples, samples, width // samples, samples)
    inked = parts.mean(axis=(1, 3))[..., None]
    return image * (1.0 - inked) + inked * INK


def _mark(edge: np.ndarray, surface: Ints, depth: Floats, jump: float) -> None:
    """Mark in `edge` (h, w) the samples between which the surface changes along a column, or the depth bends."""
    changes = surface[1:] != surface[:-1]
    edge[:-1] |= changes
    edge[1:] |= changes
    edge[1:-1] |= np.abs(np.diff(depth, n=2, axis=0)) > jump


RIB_PIXELS = 6.0
"""Width of a rib where the cloth is nearest to the median distance: real threads are far finer than a pixel."""
RIB_DEPTH, THREAD_DEPTH = 0.10, 0.05
"""Amplitudes of the brightness across ribs, and along them between threads."""
FINEST = 0.35
"""Periods a sample from which on a rib is not drawn: it would alias."""
SHEEN = 0.22
"""Brightness that fibres add where they are seen at a grazing angle."""


def woven(image: Floats, geometry: PixelGeometry, cloths: np.ndarray, samples: int) -> Floats:
    """Return the picture (h, w, 3) with its cloths woven.

    Parameters
    ----------
    image : (h, w, 3) float64
        sRGB in [0, 1].
    geometry : PixelGeometry
        Of its samples, (h samples, w samples).
    cloths : (k,) bool
        True for the surfaces that are cloths.
    samples : int
        Samples of a pixel in each direction.
    """
    on_cloth = (geometry.surface >= 0) & cloths[geometry.surface]
    if not on_cloth.any():
        return image
    x, facing = geometry.material, np.abs(geometry.side).argmax(axis=2)
    first, second = np.array([1, 0, 0])[facing], np.array([2, 2, 1])[facing]
    along, across = tuple(np.take_along_axis(x, axes[..., None], axis=2)[..., 0] for axes in (first, second))
    both = on_cloth[:, 1:] & on_cloth[:, :-1] & (geometry.surface[:, 1:] == geometry.surface[:, :-1])
    steps = np.hypot(np.diff(along, axis=1), np.diff(across, axis=1))[both]
    pitch = (float(np.median(steps)) if len(steps) else 1.0) * samples * RIB_PIXELS
    factor = 1.0 + RIB_DEPTH * _wave((along + across) / pitch, geometry, on_cloth)
    factor += THREAD_DEPTH * _wave((along - across) / (0.5 * pitch), geometry, on_cloth)
    sheen = np.where(on_cloth, SHEEN * (1.0 - geometry.facing) ** 3, 0.0)
    return np.clip(image * _mean(factor, samples) + _mean(sheen, samples) * (1.0 - image), 0.0, 1.0)


def _wave(phase: Floats, geometry: PixelGeometry, on_cloth: np.ndarray) -> Floats:
    """cos(2 pi phase), fading to 0 where a period spans few samples or the surface changes."""
    steps = np.zeros(phase.shape)
    for axis in (0, 1):
        change = np.abs(np.diff(phase, axis=axis))
        same = np.diff(geometry.surface, axis=axis) == 0
        pad = ((0, 1), (0, 0)) if axis == 0 else ((0, 0), (0, 1))
        steps = np.maximum(steps, np.pad(np.where(same, change, 1.0), pad, mode="edge"))
    visible = np.clip(1.0 - steps / FINEST, 0.0, 1.0)
    return np.where(on_cloth, visible * np.cos(2.0 * np.pi * phase), 0.0)


def _mean(values: Floats, samples: int) -> Floats:
    """Mean over the samples of each pixel, (h, w, 1)."""
    height, width = values.shape[0] // samples, values.shape[1] // samples
    return values.reshape(height, samples, width, samples).mean(axis=(1, 3))[..., None]


def dyes_of(text: str) -> Floats:
    """SRGB in [0, 1] of the two threads of each cloth, (k, 2, 3), from CSS colours: `navy`, or `firebrick/white,navy`.

    A comma parts the cloths, a slash the two dyes of a check. InputError for a colour that is unknown.

    >>> dyes_of("red,#0000ff/white").tolist()
    [[[1.0, 0.0, 0.0], [1.0, 0.0, 0.0]], [[0.0, 0.0, 1.0], [1.0, 1.0, 1.0]]]
    """
    cloths = []
    for cloth in text.split(","):
        names = [name.strip() for name in cloth.split("/")]
        try:
            dyes = [ImageColor.getrgb(name)[:3] for name in names]
        except ValueError:
            dyes = []
        if len(dyes) not in (1, 2):
            raise InputError(
                f"colour: {cloth!r:.80} is not a colour.",
                'Give "stretch", "plain", a CSS colour ("navy", "#8c2f39"), or two with a slash for a check.',
            )
        cloths.append([dyes[0], dyes[-1]])
    return np.array(cloths, np.float64) / 255.0
