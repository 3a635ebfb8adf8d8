"""Invariants of chaotic folds: distribution of heights, drape coefficient."""

import numpy as np

from clothsim.base.arrays import Floats, Ints

QUANTILES = 64
PIXELS = 1024


def height_quantiles(positions: Floats, areas: Floats, up: Floats) -> Floats:
    """The heights [m] below which equal fractions of the area lie, (QUANTILES, 1): height quantiles.

    The RMS difference of two of them is the 2-Wasserstein distance of the two histograms; their mean over seeds is the
    histograms' barycentre.
    """
    heights = positions @ up
    order = np.argsort(heights, kind="stable")
    quantiles = np.cumsum(areas[order]) - 0.5 * areas[order]
    wanted = (np.arange(QUANTILES) + 0.5) / QUANTILES * areas.sum()
    return np.interp(wanted, quantiles, heights[order])[:, None]


def drape_coefficient(positions: Floats, triangles: Ints, area: float, up: Floats) -> float:
    """The area of the shadow along `up` over `area`, the cloth's own [m2]; drawn with PIXELS along its longer side."""
    from PIL import Image, ImageDraw

    aside = np.linalg.svd(up[None])[2][1:]
    flat = positions @ aside.T
    low = flat.min(axis=0)
    scale = (PIXELS - 1) / max(float((flat.max(axis=0) - low).max()), np.finfo(float).tiny)
    image = Image.new("1", (PIXELS, PIXELS))
    draw = ImageDraw.Draw(image)
    for corners in ((flat - low) * scale)[triangles]:
        draw.polygon([tuple(corner) for corner in corners], fill=1)
    return float(np.asarray(image).sum() / scale**2 / area)
