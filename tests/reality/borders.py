"""Scanned Cusick drapes: outline shapes of 459 lays of 16 fabrics (Gong, Mao, Wang 2024, CVPR)."""

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
    """Lays of one fabric: coefficient, n_eff and sd r [m] of those that a fit sees, and of those to be predicted."""

    fabric: int
    fitted: Floats
    others: Floats

    @property
    def centre(self) -> Floats:
        """Mean of the fitted lays, (3,)."""
        return np.asarray(self.fitted.mean(axis=0))


def measured_lays(folder: Path) -> list[Lays]:
    """The lays of each fabric in a folder of data, by number."""
    with np.load(folder / NAME) as data:
        points = UNIT * data["border_50um"][:, :, :2].astype(np.float64)
        labels = np.column_stack([data[key] for key in ("fabric", "session", "specimen", "capture")])
    edges = np.column_stack([np.arange(360), (np.arange(360) + 1) % 360])
    shapes = [outline_shape(outline_radii(each, edges)) for each in points]
    values = np.array([[each.coefficient, each.folds, each.depth] for each in shapes])
    kept = ~(labels[:, [0, 2, 3]] == DROPPED).all(axis=1)
    labels, values = labels[kept], values[kept]
    found = []
    for fabric in np.unique(labels[:, 0]):
        own, lays = labels[labels[:, 0] == fabric], values[labels[:, 0] == fabric]
        first = (own[:, 1] == own[0, 1]) & (own[:, 2] == own[:, 2].min())
        seen = first & np.isin(own[:, 3], FITTED)
        if not seen.any():
            seen = first
        found.append(Lays(int(fabric), lays[seen], lays[~seen]))
    return found
