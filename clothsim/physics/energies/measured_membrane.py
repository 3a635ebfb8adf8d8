"""Membrane from measured stress-strain tables, as of tensile tests of strips along warp and weft.

Each table is rows [strain, stress], the strain an engineering one and the stress in newtons per metre of width as cut.
Between the rows the stress is a monotone cubic (Fritsch, Carlson 1980; scipy's PCHIP), integrated to an energy; beyond
the last row it continues with the slope there, and in compression, which no such test measures, with the initial slope.
Rows of shear are [sine of the change of angle between warp and weft, shear stress].

A knit narrows as it is pulled. With a table g of narrowing, the strain that a stretch along one takes from the width,
each direction has the energy of its own table at the strain that is left when the other's narrowing is undone,

    psi = W1(e1 + g2(e2)) + W2(e2 + g1(e1)),   e = l - 1,   g and g' = 0 for e <= 0.

A strip pulled along the warp has e2 = -g1(e1) free of stress across, so W1' is its table, exactly, with or without
narrowing; where its width is held, as at a clamp, W2'(g1) g1' comes to it, which stiffens as the table across does.
With straight g the second derivative is positive where g1' g2' < 1; besides it has W2' g1'', which is negative where
the narrowing levels off under tension across. Without such tables warp and weft are not coupled.

As in the woven one, a Neo-Hookean sheet with lam = 0 prevents collapsed triangles; mu is a tenth of the smallest
initial secant of a table, and the stress that it adds along the threads, mu (l - 1/l), and in shear, mu I8 to third
order, is subtracted.
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
class StressCurve:
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
class Narrowing:
    """Strain g that a stretch takes from the width: a monotone cubic with g = g' = 0 at 0, linear beyond `last`.

    Parameters
    ----------
    value, slope, curvature : piecewise polynomials
        g and its derivatives.
    last : float
        Strain of the last row.
    """

    value: Any
    slope: Any
    curvature: Any
    last: float

    @classmethod
    def through(cls, strains: Floats, narrowings: Floats) -> Self:
        """Through the rows of a table that begins with 0, 0; a row of 0 before them makes it level at 0."""
        before = np.concatenate([[-strains[1]], strains]), np.concatenate([[0.0], narrowings])
        value = PchipInterpolator(*before)
        slope = value.derivative()
        return cls(value, slope, slope.derivative(), float(strains[-1]))

    @property
    def steepest(self) -> float:
        """The largest g': it is at a row, or where g'' = 0 between two."""
        level = self.curvature.roots(extrapolate=False)
        return float(self.slope(np.concatenate([self.slope.x, level[np.isfinite(level)]])).max())

    def at(self, strain: Floats) -> tuple[Floats, Floats, Floats]:
        """g, g' and g'' at strains (m,)."""
        inside = np.clip(strain, 0.0, self.last)
        slope = self.slope(inside)
        within = (strain > 0) & (strain < self.last)
        beyond = np.maximum(strain - self.last, 0.0)
        return self.value(inside) + slope * beyond, slope, np.where(within, self.curvature(inside), 0.0)


@dataclass(frozen=True)
class MeasuredThreads:
    """The law (`woven_membrane.ThreadLaw`) of three tables, less the stress of the sheet of modulus mu [N/m].

    narrowings : pair of Narrowing or None
        Of a stretch along the warp, and along the weft; None: the other direction does not heed it.
    """

    warp: StressCurve
    weft: StressCurve
    shear: StressCurve
    mu: float
    narrowings: tuple[Narrowing | None, Narrowing | None] = (None, None)

    def of(self, triangles: Ints) -> Self:
        """The law itself, which is the same for all triangles."""
        return self

    def density(self, measured: Floats) -> Floats:
        """psi, (m,) [J/m2]."""
        la, lb, shear = measured.T
        (a, b), _ = self._strains(la - 1, lb - 1)
        tables = self.warp.at(a)[0] + self.weft.at(b)[0] + self.shear.at(np.abs(shear))[0]
        sheet = sum(0.5 * (s * s - 1) - np.log(s) for s in (la, lb)) + 0.5 * shear**2
        return np.asarray(tables - self.mu * sheet, np.float64)

    def slopes(self, measured: Floats) -> Floats:
        """d psi/d(la, lb, I8), (m, 3) [N/m]."""
        la, lb, shear = measured.T
        (a, b), ((slope_a, _), (slope_b, _)) = self._strains(la - 1, lb - 1)
        own_a, own_b = self.warp.at(a)[1], self.weft.at(b)[1]
        along_a = own_a - self.mu * (la - 1 / la) + own_b * slope_a
        along_b = own_b - self.mu * (lb - 1 / lb) + own_a * slope_b
        across = np.sign(shear) * self.shear.at(np.abs(shear))[1] - self.mu * shear
        return np.column_stack([along_a, along_b, across])

    def curvatures(self, measured: Floats) -> Floats:
        """The second derivatives aa, ab, bb and 88, (m, 4) [N/m]."""
        la, lb, shear = measured.T
        (a, b), ((slope_a, curved_a), (slope_b, curved_b)) = self._strains(la - 1, lb - 1)
        (_, stress_a, own_a), (_, stress_b, own_b) = self.warp.at(a), self.weft.at(b)
        aa = own_a - self.mu * (1 + 1 / la**2) + own_b * slope_a**2 + stress_b * curved_a
        bb = own_b - self.mu * (1 + 1 / lb**2) + own_a * slope_b**2 + stress_a * curved_b
        ab = own_a * slope_b + own_b * slope_a
        return np.column_stack([aa, ab, bb, self.shear.at(np.abs(shear))[2] - self.mu])

    def _strains(self, a: Floats, b: Floats) -> tuple[tuple[Floats, Floats], list[tuple[Floats, Floats]]]:
        """The strains of both tables, each with the other's narrowing undone, and g' and g'' along warp and weft."""
        none = np.zeros(len(a))
        g = [(none, none, none) if law is None else law.at(e) for law, e in zip(self.narrowings, (a, b), strict=True)]
        return (a + g[1][0], b + g[0][0]), [each[1:] for each in g]


def measured(
    world: World,
    angles: Floats,
    warp: ArrayLike,
    weft: ArrayLike,
    shear: ArrayLike,
    narrowing_warp: ArrayLike = (),
    narrowing_weft: ArrayLike = (),
) -> ThreadedMembrane:
    """The measured membrane of all cloths.

    Parameters
    ----------
    angles : (m,) array
        Angle of the warp in each triangle [rad].
    warp, weft, shear : (k, 2) tables
        Rows of strain and stress [N/m]. An empty weft equals the warp; an empty shear is linear with the
        fabric's modulus.
    narrowing_warp, narrowing_weft : (k, 2) tables
        Rows of strain along the warp, or the weft, and the strain that it takes from the width; empty: none.

    Raises
    ------
    InputError
        Names the row of a table that is not increasing, and a narrowing that leaves no width.
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
    curves = {name: StressCurve.through(*table.T) for name, table in tables.items()}
    mu = SHEET * min(float(table[1, 1] / table[1, 0]) for table in tables.values())
    notes = tuple(
        f"the table of {name} ends at {100 * curves[name].last:g} %, beyond it continues with the slope "
        f"{curves[name].end:.4g} N/m"
        for name in ("warp", "weft")
    )
    every = np.arange(len(world.triangles))
    narrowings = _narrowing("narrowing_warp", narrowing_warp), _narrowing("narrowing_weft", narrowing_weft)
    steepest_of_both = np.prod([0.0 if each is None else each.steepest for each in narrowings])
    if steepest_of_both >= 1:
        raise InputError(
            f"effects.membrane has narrowings whose steepest slopes multiply to {steepest_of_both:.3g}, not below 1.",
            "Such a sheet is not stable: give rows of less narrowing.",
        )
    law = MeasuredThreads(curves["warp"], curves["weft"], curves["shear"], mu, narrowings)
    return ThreadedMembrane.of(world, every, angles, (np.full(len(every), mu), np.zeros(len(every))), law, notes)


def _narrowing(key: str, given: ArrayLike) -> Narrowing | None:
    """The narrowing of a table, None of an empty one."""
    if not np.size(given):
        return None
    table = _table(f"effects.membrane.{key}", given, "narrowing", "")
    if table[-1, 1] >= 1:
        raise InputError(
            f"effects.membrane.{key} takes {table[-1, 1]:g} of the width, which is all of it.", "Give rows below 1."
        )
    return Narrowing.through(*table.T)


def _table(name: str, given: ArrayLike, what: str = "stress", unit: str = " N/m") -> Floats:
    """The rows (k, 2) of a table of strain and `what`, with 0, 0 before them."""
    example = "Such as [[0.02, 5.0], [0.05, 20.0]]." if what == "stress" else "Such as [[0.1, 0.02], [0.4, 0.12]]."
    try:
        rows = np.asarray(given, np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} must be rows [strain, {what}].", example) from error
    if rows.ndim != 2 or rows.shape[1] != 2 or not len(rows):
        raise InputError(f"{name} must be rows [strain, {what}].", example)
    skipped = int(not rows[0].any())
    if len(rows) == skipped:
        raise InputError(f"{name} has only the row 0, 0.", f"Give a row with a {what}.")
    whole = np.concatenate([np.zeros((1, 2)), rows[skipped:]])
    for k, (before, row) in enumerate(zip(whole[:-1], whole[1:], strict=True), start=skipped):
        if not np.isfinite(row).all():
            raise InputError(f"{name}[{k}] is {row.tolist()}, not two finite numbers.")
        if row[0] <= before[0]:
            raise InputError(f"{name}[{k}] has strain {row[0]:g}, not above {before[0]:g}.", "Sort the rows by strain.")
        if row[1] <= before[1]:
            sentence = f"{name}[{k}] has {what} {row[1]:g}{unit}, not above {before[1]:g}."
            raise InputError(sentence, "It must increase for a stable sheet: leave the row out.")
    return whole
