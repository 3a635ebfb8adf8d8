"""Scanned Cusick drapes: outline shapes of 459 lays of 16 fabrics (Gong, Mao, Wang 2024, CVPR)."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from clothsim.base.arrays import Floats, Ints
from clothsim.study.standard_tests.cusick import outline_radii, outline_shape

NAME = "cusick_borders.npz"
UNIT = 0.05e-3
DROPPED = ((8, 1, 2, 1), (3, 1, 2, 3))
"""Fabric, session, specimen and capture of a scan that is no drape, and of one that is a copy of capture 1."""
SERIES = (1, 2)
"""Fabric and session whose captures are observations of one lay after another, as it creeps: the last one counts."""
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


def scatter_of_centres(all_lays: Sequence[Lays]) -> list[Floats]:
    """By how much the mean of a fabric's fitted lays misses that of its others (3,), for each fabric over the rest.

    The fitted lays are of one specimen, and specimens of a fabric differ: this is what they tell of the fabric.
    """
    squares = np.array([(each.centre - each.others.mean(axis=0)) ** 2 for each in all_lays])
    return [np.sqrt(np.delete(squares, k, axis=0).mean(axis=0)) for k in range(len(squares))]


def scans(folder: Path) -> tuple[Ints, Floats]:
    """Fabric, session, specimen and capture (n, 4) of the lays in a folder of data, and their outlines (n, 360) [m]."""
    with np.load(folder / NAME) as data:
        points = UNIT * data["border_50um"][:, :, :2].astype(np.float64)
        labels = np.column_stack([data[key] for key in ("fabric", "session", "specimen", "capture")]).astype(np.int64)
    kept = single_lays(labels)
    edges = np.column_stack([np.arange(360), (np.arange(360) + 1) % 360])
    return labels[kept], np.array([outline_radii(each, edges) for each in points[kept]])


def measured_lays(labels: Ints, radii: Floats) -> list[Lays]:
    """The lays of each fabric, by number, of `scans`."""
    shapes = [outline_shape(each) for each in radii]
    shifts = np.sqrt(2) * np.abs(np.fft.rfft(radii, axis=1)[:, 1]) / radii.shape[1]
    values = np.array([[each.coefficient, each.folds, each.depth] for each in shapes])
    found = []
    for fabric in np.unique(labels[:, 0]):
        of_it = labels[:, 0] == fabric
        own, lays = labels[of_it], values[of_it]
        first = own[:, 1] == own[:, 1].min()
        first &= own[:, 2] == own[first, 2].min()
        seen = first & np.isin(own[:, 3], FITTED)
        if not seen.any():
            seen = first
        off_axis = float(np.sqrt(np.mean(shifts[of_it][seen] ** 2)))
        found.append(Lays(int(fabric), lays[seen], lays[~seen], off_axis))
    return found


def single_lays(labels: Ints) -> NDArray[np.bool_]:
    """True for the captures that count: one of each lay, by fabric, session, specimen and capture (n, 4)."""
    kept = np.array([tuple(each) not in DROPPED for each in labels.tolist()])
    series = np.flatnonzero((labels[:, :2] == SERIES).all(axis=1))
    for specimen in np.unique(labels[series, 2]):
        of_it = series[labels[series, 2] == specimen]
        kept[of_it] = labels[of_it, 3] == labels[of_it, 3].max()
    return kept
