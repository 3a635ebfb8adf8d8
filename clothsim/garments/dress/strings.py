"""Straight strings between both sides of a seam, and those that run through the body."""

import numpy as np
from numpy.typing import NDArray

from clothsim.base.arrays import Floats
from transfer.signed_distance import BodySurface


def strings_through(ends: Floats, surface: BodySurface) -> int:
    """Number of the segments (k, 2, 3) that meet the body."""
    return int(runs_through(ends, surface).sum())


def runs_through(ends: Floats, surface: BodySurface) -> NDArray[np.bool_]:
    """True for each segment (k, 2, 3) that meets the body, (k,)."""
    along = ends[:, 1] - ends[:, 0]
    lengths = np.linalg.norm(along, axis=1)
    directions = along / np.maximum(lengths, np.finfo(float).tiny)[:, None]
    distance, _ = surface.exits(ends[:, 0], directions)
    return np.asarray(distance < lengths)
