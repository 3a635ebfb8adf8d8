"""Outlines of a picture: ink along borders, silhouettes and folds, from the depth that its samples see."""

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.render.pixel_geometry import PixelGeometry

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
    share = parts.mean(axis=(1, 3))[..., None]
    return image * (1.0 - share) + share * INK


def _mark(edge: np.ndarray, surface: Ints, depth: Floats, jump: float) -> None:
    """Mark in `edge` (h, w) the samples between which the surface changes along a column, or the depth bends."""
    changes = surface[1:] != surface[:-1]
    edge[:-1] |= changes
    edge[1:] |= changes
    edge[1:-1] |= np.abs(np.diff(depth, n=2, axis=0)) > jump
