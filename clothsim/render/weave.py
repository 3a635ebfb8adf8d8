"""Woven look of a cloth: ribs of a twill fixed to the material, and the sheen of its fibres."""

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.render.pixel_geometry import PixelGeometry

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
    along, across = _plane_coordinates(geometry)
    pitch = _pitch(geometry, along, across, on_cloth) * samples * RIB_PIXELS
    factor = 1.0 + RIB_DEPTH * _wave((along + across) / pitch, geometry, on_cloth)
    factor += THREAD_DEPTH * _wave((along - across) / (0.5 * pitch), geometry, on_cloth)
    sheen = np.where(on_cloth, SHEEN * (1.0 - geometry.facing) ** 3, 0.0)
    return np.clip(image * _mean(factor, samples) + _mean(sheen, samples) * (1.0 - image), 0.0, 1.0)


def _plane_coordinates(geometry: PixelGeometry) -> tuple[Floats, Floats]:
    """Two coordinates of the material in the plane of the axes that its side faces least [m]."""
    x, facing = geometry.material, np.abs(geometry.side).argmax(axis=2)
    first, second = np.array([1, 0, 0])[facing], np.array([2, 2, 1])[facing]
    return tuple(np.take_along_axis(x, axes[..., None], axis=2)[..., 0] for axes in (first, second))  # type: ignore[return-value]


def _pitch(geometry: PixelGeometry, along: Floats, across: Floats, on_cloth: np.ndarray) -> float:
    """Median distance in the material between neighbouring samples [m]."""
    both = on_cloth[:, 1:] & on_cloth[:, :-1] & (geometry.surface[:, 1:] == geometry.surface[:, :-1])
    steps = np.hypot(np.diff(along, axis=1), np.diff(across, axis=1))[both]
    return float(np.median(steps)) if len(steps) else 1.0


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
