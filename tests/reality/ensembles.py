"""Ensembles of simulated drapes by bending length: what sheets of each stiffness do, lay by lay.

A drape is decided by D/(rho g), by warp over weft, by the membrane over the weight and by the laying. Common to all
fabrics are rho .2 kg/m2, E2 300 N/m, nu .243, a shear stiffness of .8 gf/(cm degree), those that `clothsim recover
--test cusick` assumes, the ring at 100 mm/s, and from the 618 fabrics of Feng et al. 2022: D at 45 degrees, how bending
softens, and which ratios of warp and weft there are. An outline does not tell which of them is the warp, so that the
ratio is the larger over the smaller.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import ndtri

from clothsim.base.arrays import Floats
from clothsim.study.drape_recovery import DENSITY, GRAVITY, REPEATABILITY, assumed_cloth, mesh_size
from clothsim.study.standard_tests.cusick import lay
from tests.reality.borders import Lays

BENDING_LENGTHS = (8.0, 11.0, 14.0, 17.0, 20.0, 23.0, 27.0, 34.0)
"""(D/(rho g))^(1/3) of the ensembles [mm], D the geometric mean of warp and weft."""
RATIOS = (1.10, 1.37, 1.72, 2.47, 3.96)
"""Bending along the stiffer over that along the softer threads: medians of the fifths of 618 fabrics by it."""
BIAS, SOFTENING = 0.97, 2.5e-3
"""D at 45 degrees over D, and -s/D of the moment D k + s k^2 [m]: medians of 618 fabrics."""
MEMBERS = 16
"""Lays that are predicted of a fabric."""


@dataclass(frozen=True)
class Fit:
    """A fabric as its fitted lays tell: bending length [mm], ratio of warp and weft, and the predicted lays (16, 3)."""

    length: float
    ratio: float
    ensemble: Floats


def sheet(length: float, ratio: float) -> dict[str, Any]:
    """Keys of [cloth] of a sheet with a bending length [m] and a ratio of warp and weft."""
    mean = DENSITY * GRAVITY * length**3
    along = {"warp": mean * ratio**0.5, "weft": mean / ratio**0.5, "bias": mean * BIAS}
    bending = {f"bending_{way}": value for way, value in along.items()}
    slopes = {f"bending_slope_{way}": -SOFTENING * value for way, value in along.items()}
    return {**assumed_cloth(length), **bending, **slopes}


def simulated(count: int, message: Callable[[str], None]) -> list[list[list[float]]]:
    """Coefficient, n_eff and sd r [m] of `count` lays of each bending length, of one ratio after the other."""
    table: list[list[list[float]]] = []
    for length in BENDING_LENGTHS:
        size = mesh_size(1e-3 * length)
        done = [lay(sheet(1e-3 * length, RATIOS[k % len(RATIOS)]), size, k) for k in range(count)]
        table.append([[each.shape.coefficient, each.shape.folds, each.shape.depth] for each in done])
        rest = sum(each.at_rest for each in done)
        text = "; ".join(f"{100 * c:.1f} %, {n:.2f}, {1e3 * d:.2f} mm" for c, n, d in table[-1])
        message(f"c {length:g} mm: {text}; {rest} at rest")
    return table


def fitted(
    table: Sequence[Sequence[Sequence[float]]], own: Lays, scatter: Floats, weigh: bool = True, centred: bool = False
) -> Fit:
    """The ensemble of a fabric, from its fitted lays alone.

    Each simulated lay has a bending length of its own at which it has the coefficient asked for: that of one of the
    fitted lays (each side has its own, as curl moves the coefficient and hardly the folds at one coefficient) and the
    scatter of measured lays. Lays count by the likelihood of the mean n_eff and sd r of the fitted lays, `scatter (3,)`
    the standard deviation of such means of one specimen about those of a fabric, so that the ratio is fitted with those
    of 618 fabrics as its prior. The outlines lie as far off the axis as the fitted ones do.

    Parameters
    ----------
    table : (lengths, lays, 3) nested lists
        Of `simulated`.
    weigh : bool
        False: all lays alike, whatever the fitted n_eff and sd r are.
    centred : bool
        True: the simulated outlines lie on the axis.
    """
    values = np.array(table)
    off = 0.0 if centred else own.off_axis
    count = values.shape[1]
    middle = np.array([_at(values[:, k], own.centre[0], off)[1] for k in range(count)])
    away = (middle[:, 1:] - own.centre[1:]) / scatter[1:]
    likely = -0.5 * (away**2).sum(axis=1) if weigh else np.zeros(count)
    weights = np.exp(likely - likely.max())
    weights /= weights.sum()
    m = np.arange(MEMBERS)
    chosen = np.minimum(np.searchsorted(np.cumsum(weights), (m + 0.5) / MEMBERS), count - 1)
    noise = REPEATABILITY * ndtri((7 * m % MEMBERS + 0.5) / MEMBERS)
    targets = own.fitted[m % len(own.fitted), 0] + noise
    found = [_at(values[:, k], target, off) for k, target in zip(chosen, targets, strict=True)]
    ratio = float(np.exp(weights @ np.log([RATIOS[k % len(RATIOS)] for k in range(count)])))
    return Fit(float(np.mean([place for place, _ in found])), ratio, np.array([shape for _, shape in found]))


def _at(values: Floats, coefficient: float, off_axis: float) -> tuple[float, Floats]:
    """Bending length [mm] at which a lay (lengths, 3) has a coefficient, and its shape (3,) there.

    On straight lines between two bending lengths, from the one on where the coefficient is least, as what is softer
    jams on its mesh; outside the table its end.
    """
    first = int(values[:, 0].argmin())
    lengths, own = np.array(BENDING_LENGTHS[first:]), values[first:]
    length = float(np.interp(coefficient, np.maximum.accumulate(own[:, 0]), lengths))
    c, n, depth = (float(np.interp(length, lengths, own[:, j])) for j in range(3))
    return length, np.array([c, n, np.hypot(depth, off_axis)])
