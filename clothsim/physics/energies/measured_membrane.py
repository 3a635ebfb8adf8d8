"""Membrane from measured stress-strain tables, as of tensile tests of strips along warp and weft.

Each table is rows [strain, stress], the strain an engineering one and the stress in newtons per metre of width as cut.
Between the rows the stress is a monotone cubic (Fritsch, Carlson 1980; scipy's PCHIP), integrated to an energy; beyond
the last row it continues with the slope there, and in compression, which no such test measures, with the initial slope.
Rows of shear are [sine of the change of angle between warp and weft, shear stress].

Warp and weft are not coupled: a stretched strip does not narrow, and reproduces its table exactly. As in the woven one,
a Neo-Hookean sheet with lam = 0 prevents collapsed triangles; mu is a tenth of the smallest initial secant of a table,
and the stress that it adds along the threads, mu (l - 1/l), and in shear, mu I8 to third order, is subtracted.
"""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import PchipInterpolator

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.mesh.world import World
from clothsim.physics.energies.woven_membrane import ThreadedMembrane

SHEET = 0.1
"""mu of the sheet relative to the smallest initial secant of a table."""


@dataclass(frozen=True)
class Curve:
    """Stress over strain from 0 to `last`, linear outside, with its integral and slope.

    Parameters
    ----------
    stress, energy, slope : piecewise polynomials
        Stress [N/m], its integral [J/m2] and its derivative [N/m].
    last : float
        Strain of the last row.
    first, end : float
        Slopes at 0 and `last` [N/m], with which the curve continues.
    """

    stress: Any
    energy: Any
    slope: Any
    last: float
    first: float
    end: float

    @classmethod
    def through(cls, strains: Floats, stresses: Floats) -> Self:
        """The monotone cubic through the rows of a table that begins with 0, 0."""
        stress = PchipInterpolator(strains, stresses)
        slope = stress.derivative()
        last = float(strains[-1])
        return cls(stress, stress.antiderivative(), slope, last, float(slope(0.0)), float(slope(last)))

    def at(self, strain: Floats) -> tuple[Floats, Floats, Floats]:
        """Energy [J/m2], stress [N/m] and slope [N/m] at strains (m,)."""
        inside = np.clip(strain, 0.0, self.last)
        beyond, straight = strain - inside, np.where(strain > 0, self.end, self.first)
        stress = self.stress(inside)
        energy = self.energy(inside) + stress * beyond + 0.5 * straight * beyond**2
        return energy, stress + straight * beyond, np.where(beyond == 0, self.slope(inside), straight)


@dataclass(frozen=True)
class MeasuredThreads:
    """The law (`woven_membrane.ThreadLaw`) of three tables, less the stress of the sheet of modulus mu [N/m]."""

    warp: Curve
    weft: Curve
    shear: Curve
    mu: float

    def of(self, triangles: Ints) -> Self:
        """The law itself, which is the same for all triangles."""
        return self

    def density(self, measured: Floats) -> Floats:
        """psi, (m,) [J/m2]."""
        la, lb, shear = measured.T
        tables = self.warp.at(la - 1)[0] + self.weft.at(lb - 1)[0] + self.shear.at(np.abs(shear))[0]
        sheet = sum(0.5 * (s * s - 1) - np.log(s) for s in (la, lb)) + 0.5 * shear**2
        return np.asarray(tables - self.mu * sheet, np.float64)

    def slopes(self, measured: Floats) -> Floats:
        """d psi/d(la, lb, I8), (m, 3) [N/m]."""
        la, lb, shear = measured.T
        along = [curve.at(s - 1)[1] - self.mu * (s - 1 / s) for curve, s in ((self.warp, la), (self.weft, lb))]
        across = np.sign(shear) * self.shear.at(np.abs(shear))[1] - self.mu * shear
        return np.column_stack([*along, across])

    def curvatures(self, measured: Floats) -> Floats:
        """The second derivatives aa, ab, bb and 88, (m, 4) [N/m]."""
        la, lb, shear = measured.T
        aa, bb = (curve.at(s - 1)[2] - self.mu * (1 + 1 / s**2) for curve, s in ((self.warp, la), (self.weft, lb)))
        return np.column_stack([aa, np.zeros(len(la)), bb, self.shear.at(np.abs(shear))[2] - self.mu])


def measured(world: World, angles: Floats, warp: ArrayLike, weft: ArrayLike, shear: ArrayLike) -> ThreadedMembrane:
    """The measured membrane of all cloths.

    Parameters
    ----------
    angles : (m,) array
        Angle of the warp in each triangle [rad].
    warp, weft, shear : (k, 2) tables
        Rows of strain and stress [N/m]. An empty weft equals the warp; an empty shear is linear with the
        fabric's modulus.

    Raises
    ------
    InputError
        Names the row of a table that is not increasing.
    """
    rows = {"warp": warp, "weft": weft if np.size(weft) else warp, "shear": shear}
    if not np.size(shear):
        modulus = float(world.per_triangle("stiffness_in_shear").min())
        if modulus == 0:
            raise InputError("effects.membrane has no shear, and the fabric no modulus.", "Give shear = [[0.1, 3.0]].")
        rows["shear"] = [[1.0, modulus]]
    tables = {name: _table(f"effects.membrane.{name}", table) for name, table in rows.items()}
    steepest = float(tables["shear"][-1, 0])
    if steepest > 1:
        raise InputError(
            f"effects.membrane.shear has the sine {steepest:g}.",
            "Give sines of angles, not degrees: 0.087 is 5 degrees.",
        )
    curves = {name: Curve.through(*table.T) for name, table in tables.items()}
    mu = SHEET * min(float(table[1, 1] / table[1, 0]) for table in tables.values())
    notes = tuple(
        f"the table of {name} ends at {100 * curves[name].last:g} %, beyond it continues with the slope "
        f"{curves[name].end:.4g} N/m"
        for name in ("warp", "weft")
    )
    every = np.arange(len(world.triangles))
    law = MeasuredThreads(curves["warp"], curves["weft"], curves["shear"], mu)
    return ThreadedMembrane.of(world, every, angles, (np.full(len(every), mu), np.zeros(len(every))), law, notes)


def _table(name: str, given: ArrayLike) -> Floats:
    """The rows (k, 2) of a table, with 0, 0 before them."""
    try:
        rows = np.asarray(given, np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} must be rows [strain, stress].", "Such as [[0.02, 5.0], [0.05, 20.0]].") from error
    if rows.ndim != 2 or rows.shape[1] != 2 or not len(rows):
        raise InputError(f"{name} must be rows [strain, stress].", "Such as [[0.02, 5.0], [0.05, 20.0]].")
    skipped = int(not rows[0].any())
    if len(rows) == skipped:
        raise InputError(f"{name} has only the row 0, 0.", "Give a row with a stress.")
    whole = np.concatenate([np.zeros((1, 2)), rows[skipped:]])
    for k, (before, row) in enumerate(zip(whole[:-1], whole[1:], strict=True), start=skipped):
        if not np.isfinite(row).all():
            raise InputError(f"{name}[{k}] is {row.tolist()}, not two finite numbers.")
        if row[0] <= before[0]:
            raise InputError(f"{name}[{k}] has strain {row[0]:g}, not above {before[0]:g}.", "Sort the rows by strain.")
        if row[1] <= before[1]:
            sentence = f"{name}[{k}] has stress {row[1]:g} N/m, not above {before[1]:g}."
            raise InputError(sentence, "Stress must increase for a stable sheet: leave the row out.")
    return whole
