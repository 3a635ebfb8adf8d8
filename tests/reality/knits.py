"""Knits pulled between clamps: tables of three pulls against the others (Singal et al. 2024, MIT).

Each specimen is simulated as cut, between its clamps, with the measured membrane: tables of stress and of narrowing of
its direction from its first three pulls, those of the other direction across. The specimens are .38 to 3.2 times as
wide as long, and the clamps hold their width, so that force over width is no stress of a free strip: the tables begin
with it, and are corrected by what the specimen between its clamps does, together for both directions of a knit.
"""

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import clothsim
from clothsim.base.arrays import Floats

NAME = "knits_uniaxial.npz"
LEFT_OUT = ("acrylic_garter_x",)
"""Its width is wrong."""
FITTED, STRETCHES, ROWS = 3, 5, 12
"""Pulls that a table sees; stretches at which forces are compared; rows of a table."""
MOST_NARROWING = 0.8
"""The most that a table may take from the width: where clamps hold it all, the correction knows no end."""
ROUNDS, DAMPED = 14, 0.5
"""Corrections of the tables, and the power of each: whole ones swing, as force and width depend on one another."""
COLUMNS = {16: (2, 4, 13, 15), 10: (2, 4, 7, 9)}
"""Columns of x of the right and left pin and of y of the bottom and top clamp, by the number of columns."""


@dataclass(frozen=True)
class Pulls:
    """Pulls of one specimen: width and length [m]; by pull strain (n, k), force [N] and width over its start."""

    name: str
    width: float
    length: float
    strains: Floats
    forces: Floats
    widths: Floats

    @property
    def last(self) -> float:
        """The strain that every pull reaches, less 5 %."""
        return 0.95 * float(np.nanmin(np.nanmax(self.strains, axis=1)))

    def at(self, strains: Floats, which: str = "forces") -> Floats:
        """Forces or widths of each pull at strains, (n, len(strains))."""
        found = []
        for strain, value in zip(self.strains, getattr(self, which), strict=True):
            known = np.isfinite(strain) & np.isfinite(value)
            order = np.argsort(strain[known])
            found.append(np.interp(strains, strain[known][order], value[known][order]))
        return np.array(found)


@dataclass(frozen=True)
class Tables:
    """Rows of strain and stress [N/m], and of strain and narrowing."""

    stress: Floats
    narrowing: Floats


@dataclass(frozen=True)
class Compared:
    """Five stretches of a knit: strains, simulated force [N], forces of the pulls (n, 5), and widths over the start."""

    name: str
    strains: Floats
    simulated: Floats
    measured: Floats
    width: float
    measured_width: float

    @property
    def held_out(self) -> Floats:
        """Mean force of the pulls that the table has not seen, (5,) [N]."""
        return np.asarray(self.measured[FITTED:].mean(axis=0))

    @property
    def within(self) -> int:
        """Number of stretches at which the simulated force is between the least and the largest of all pulls."""
        return int(
            ((self.simulated >= self.measured.min(axis=0)) & (self.simulated <= self.measured.max(axis=0))).sum()
        )


def measured_pulls(folder: Path) -> list[Pulls]:
    """The pulls of each specimen in a folder of data."""
    found = []
    with np.load(folder / NAME) as data:
        for name in data.files:
            if name.endswith("__width_mm") or name in LEFT_OUT:
                continue
            rows = data[name].astype(np.float64)
            right, left, bottom, top = COLUMNS[rows.shape[2]]
            length = np.abs(rows[:, :, bottom] - rows[:, :, top])
            across = rows[:, :, right] - rows[:, :, left]
            start = np.nanmin(length, axis=1, keepdims=True)
            narrowed = across / np.nanmax(across[:, :5], axis=1, keepdims=True)
            width = 1e-3 * float(data[f"{name}__width_mm"])
            found.append(Pulls(name, width, 1e-3 * float(start.mean()), length / start - 1, rows[:, :, 1], narrowed))
    return found


def tables_of(pulls: Pulls) -> Tables:
    """The mean of the first three pulls over the width, and the width that they lose."""
    strains = np.linspace(0, pulls.last, ROWS + 1)[1:]
    stress = pulls.at(strains)[:FITTED].mean(axis=0) / pulls.width
    ways = stretches(pulls)
    lost = 1 - np.nanmean(pulls.at(ways, "widths")[:FITTED], axis=0)
    return Tables(_rising(strains, stress, 1e-3), _rising(ways, lost, 1e-4))


def stretches(pulls: Pulls) -> Floats:
    """The strains that are compared, (5,)."""
    return pulls.last * np.arange(1, STRETCHES + 1) / STRETCHES


def _rising(strains: Floats, values: Floats, least: float) -> Floats:
    """Rows of a table, which must rise; force and width are noisy."""
    rising = np.maximum.accumulate(np.maximum(values, 0.0)) + least * np.arange(1, len(values) + 1)
    return np.column_stack([strains, rising])


def pulled(pulls: Pulls, own: Tables, across: Tables) -> tuple[Floats, Floats]:
    """Simulate the specimen between its clamps: forces [N] and widths over the start at the five stretches."""
    specimen = {"mesh": "rectangle", "size": [pulls.length, pulls.width], "cells": [8, 8], "fabric": "interlock"}
    motion = {"velocity": [float(pulls.last * pulls.length), 0.0, 0.0]}
    curves = {"warp": own.stress, "narrowing_warp": own.narrowing, "weft": across.stress}
    effects = {
        "pins": {"group": [{"select": "left"}, {"select": "right", "motion": motion}]},
        "membrane": {"material": "measured", "shear": [[0.5, 20.0]]} | {k: v.tolist() for k, v in curves.items()},
    }
    scene = clothsim.Scene(
        specimen,
        effects=effects,
        solver={"dt": 1 / STRETCHES, "unstable_equilibrium": "keep"},
        run={"duration": 1.0, "frames_per_second": STRETCHES, "forces": True},
    )
    with tempfile.TemporaryDirectory(prefix="clothsim-") as folder:
        run = clothsim.simulate(scene, folder, overwrite=True)
        forces = run.forces().pins["pins.group[1]"][:, 0]
        shapes = [run.positions(k) for k in range(1, STRETCHES + 1)]
    middle = np.abs(shapes[-1][:, 0] - shapes[-1][:, 0].mean()) < 0.1 * np.ptp(shapes[-1][:, 0])
    return forces, np.array([np.ptp(x[middle, 1]) / pulls.width for x in shapes])


def corrected(pulls: Pulls, own: Tables, forces: Floats, widths: Floats) -> Tables:
    """Tables of the specimen for which the simulated forces and widths were those of its first three pulls."""
    ways, fitted = stretches(pulls), tables_of(pulls)
    strains, stress = own.stress.T
    short = np.interp(ways, *fitted.stress.T) * pulls.width / np.maximum(forces, 1e-3)
    wider = fitted.narrowing[:, 1] / np.maximum(1 - widths, 1e-3)
    factors, narrower = (np.clip(each, 0.25, 4.0) ** DAMPED for each in (short, wider))
    return Tables(
        _rising(strains, stress * np.interp(strains, ways, factors), 1e-3),
        _rising(ways, np.minimum(own.narrowing[:, 1] * narrower, MOST_NARROWING), 1e-4),
    )


def compared(pulls: Sequence[Pulls]) -> list[Compared]:
    """One or both directions of a knit, each beside its pulls; a direction alone has its own tables across too."""
    tables = [tables_of(each) for each in pulls]
    found = [pulled(each, own, tables[-1 - k]) for k, (each, own) in enumerate(zip(pulls, tables, strict=True))]
    for _ in range(ROUNDS):
        tables = [corrected(*each) for each in zip(pulls, tables, *zip(*found, strict=True), strict=True)]
        found = [pulled(each, own, tables[-1 - k]) for k, (each, own) in enumerate(zip(pulls, tables, strict=True))]
    results = []
    for each, (forces, widths) in zip(pulls, found, strict=True):
        ways = stretches(each)
        lost = float(np.nanmean(each.at(ways, "widths")[FITTED:, -1]))
        results.append(Compared(each.name, ways, forces, each.at(ways), float(widths[-1]), lost))
    return results


def compared_knits(folder: Path) -> list[Compared]:
    """Every knit in its directions."""
    knits: dict[str, list[Pulls]] = {}
    for each in measured_pulls(folder):
        knits.setdefault(each.name[:-1], []).append(each)
    return [found for pulls in knits.values() for found in compared(pulls)]
