"""Ensembles of simulated drapes by bending length: what a fabric of each stiffness does, lay by lay.

A drape is decided by D/(rho g), by the membrane over the weight and by the laying. Only the first differs between the
fabrics here; the others are common to all, those that `clothsim recover --test cusick` assumes: rho .2 kg/m2, E2 300
N/m, nu .243, a shear stiffness of .8 gf/(cm degree), bending along warp, weft and bias as the medians of 618 fabrics
are to one another (13.8, 8.8, 11.5; Feng 2022), the ring at 100 mm/s.
"""

from collections.abc import Callable, Sequence

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.study.drape_recovery import cloth_of, mesh_size
from clothsim.study.standard_tests.cusick import lays

BENDING_LENGTHS = (8.0, 9.5, 11.0, 13.0, 15.0, 17.0, 19.0, 21.5, 24.5, 28.0, 33.0)
"""(D/(rho g))^(1/3) of the ensembles [mm]."""


def simulated(count: int, message: Callable[[str], None]) -> list[list[list[float]]]:
    """Coefficient, n_eff and sd r [m] of `count` lays of each bending length."""
    table = []
    for length in BENDING_LENGTHS:
        done = lays(cloth_of(1e-3 * length), count, mesh_size(1e-3 * length))
        table.append([[each.shape.coefficient, each.shape.folds, each.shape.depth] for each in done])
        mean = np.mean(table[-1], axis=0)
        rest = sum(each.at_rest for each in done)
        message(f"c {length:g} mm: {100 * mean[0]:.1f} %, {mean[1]:.2f}, {1e3 * mean[2]:.2f} mm, {rest} at rest")
    return table


def of_coefficient(table: Sequence[Sequence[Sequence[float]]], coefficient: float) -> tuple[float, Floats]:
    """Bending length [mm] whose mean coefficient is that of measured lays, and its ensemble (lays, 3).

    Lay by lay on straight lines between two bending lengths: the same seed is the same mesh and unevenness. Outside
    the table its end is taken; it begins where the coefficient is least: what is softer jams on this mesh.
    """
    values = np.array(table)
    first = int(values[:, :, 0].mean(axis=1).argmin())
    values, lengths = values[first:], BENDING_LENGTHS[first:]
    means = np.maximum.accumulate(values[:, :, 0].mean(axis=1))
    place = float(np.interp(coefficient, means, np.arange(len(means))))
    below = min(int(place), len(means) - 2)
    share = place - below
    ensemble = (1 - share) * values[below] + share * values[below + 1]
    return float(np.interp(place, np.arange(len(means)), lengths)), ensemble
