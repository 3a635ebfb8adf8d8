"""SRGB and linear intensities (IEC 61966-2-1)."""

import numpy as np

from clothsim.base.arrays import Floats


def linear_rgb(colours: Floats) -> Floats:
    """Linear intensities of sRGB values in [0, 1].

    >>> linear_rgb(np.array([0.0, 0.5, 1.0])).round(3).tolist()
    [0.0, 0.214, 1.0]
    """
    return np.where(colours <= 0.04045, colours / 12.92, ((colours + 0.055) / 1.055) ** 2.4)


def srgb(intensities: Floats) -> Floats:
    """SRGB values of linear intensities in [0, 1]: the inverse of `linear_rgb`.

    >>> srgb(linear_rgb(np.array([0.02, 0.7]))).round(9).tolist()
    [0.02, 0.7]
    """
    curved = 1.055 * np.maximum(intensities, 0.0031308) ** (1 / 2.4) - 0.055
    return np.where(intensities <= 0.0031308, 12.92 * intensities, curved)
