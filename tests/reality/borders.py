"""Scanned Cusick drapes: outline shapes of 459 lays of 16 fabrics (Gong, Mao, Wang 2024, CVPR)."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.study.standard_tests.outline_shape import outline_radii, outline_shape

NAME = "cusick_borders.npz"
UNIT = 0.05e-3
DROPPED = (8, 2, 1)
"""Fabric, specimen and capture of the one scan that is no drape."""
FITTED = (1, 3)
"""Captures of one specimen that a fit may see; where there are none, the specimen's first."""


@dataclass(frozen=True)
class Lays:
    """Lays of one fabric: coefficient, n_eff and sd r [m] of those that a fit sees, and of those to be predicted.

    off_axis : the part of sd r of the fitted lays that is their first harmonic, a shift of the outline [m].
    """

    fabric: int
    fitted: Floats
    others: Floats
    off_axis: float = 0.0

    @property
    def centre(self) -> Floats:
        """Mean of the fitted lays, (3,)."""
        return np.asarray(self.fitted.mean(axis=0))


def scatter_of_fitted(all_lays: Sequence[Lays]) -> Floats:
    """Standard deviation of the fitted lays of a fabric, pooled over the fabrics that have two, (3,)."""
    several = [each.fitted.var(axis=0, ddof=1) for each in all_lays if len(each.fitted) > 1]
    return np.asarray(np.sqrt(np.mean(several, axis=0)))


def measured_lays(folder: Path) -> list[Lays]:
    """The lays of each fabric in a folder of data, by number."""
    with np.load(folder / NAME) as data:
        points = UNIT * data["border_50um"][:, :, :2].astype(np.float64)
        labels = np.column_stack([data[key] for key in ("fabric", "session", "specimen", "capture")])
    edges = np.column_stack([np.arange(360), (np.arange(360) + 1) % 360])
    radii = np.array([outline_radii(each, edges) for each in points])
    shapes = [outline_shape(each) for each in radii]
    shifts = np.sqrt(2) * np.abs(np.fft.rfft(radii, axis=1)[:, 1]) / radii.shape[1]
    values = np.array([[each.coefficient, each.folds, each.depth] for each in shapes])
    kept = ~(labels[:, [0, 2, 3]] == DROPPED).all(axis=1)
    labels, values, shifts = labels[kept], values[kept], shifts[kept]
    found = []
    for fabric in np.unique(labels[:, 0]):
        of_it = labels[:, 0] == fabric
        own, lays = labels[of_it], values[of_it]
        first = (own[:, 1] == own[0, 1]) & (own[:, 2] == own[:, 2].min())
        seen = first & np.isin(own[:, 3], FITTED)
        if not seen.any():
            seen = first
        off_axis = float(np.sqrt(np.mean(shifts[of_it][seen] ** 2)))
        found.append(Lays(int(fabric), lays[seen], lays[~seen], off_axis))
    return found
