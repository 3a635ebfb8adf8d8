"""Knits pulled between clamps: tables of three pulls against the others (Singal et al. 2024, MIT).

Each specimen is simulated as cut, between its clamps, with the measured membrane: the table of its direction from its
first three pulls, that of the other direction across. Warp and weft of that membrane are not coupled, so that the sheet
does not narrow, and a table of force over width of one specimen is right for specimens of its shape alone.
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
class Compared:
    """Five stretches of a knit: strains, simulated force [N], forces of the pulls (n, 5), contraction of both."""

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


def table_of(pulls: Pulls) -> list[list[float]]:
    """Rows of strain and force over width [N/m], the mean of the first three pulls, rising."""
    strains = np.linspace(0, pulls.last, ROWS + 1)[1:]
    stress = pulls.at(strains)[:FITTED].mean(axis=0) / pulls.width
    rising = np.maximum.accumulate(stress) + 1e-3 * np.arange(1, ROWS + 1)  # a table must rise; force is noisy
    return np.column_stack([strains, rising]).tolist()


def compared(pulls: Pulls, across: Sequence[Sequence[float]]) -> Compared:
    """Simulate the specimen between its clamps; across: the table of the other direction."""
    ways = pulls.last * np.arange(1, STRETCHES + 1) / STRETCHES
    specimen = {"mesh": "rectangle", "size": [pulls.length, pulls.width], "cells": [8, 8], "fabric": "interlock"}
    motion = {"velocity": [float(pulls.last * pulls.length), 0.0, 0.0]}
    effects = {
        "pins": {"group": [{"select": "left"}, {"select": "right", "motion": motion}]},
        "membrane": {"material": "measured", "warp": table_of(pulls), "weft": across, "shear": [[0.5, 20.0]]},
    }
    scene = clothsim.Scene(
        specimen,
        effects=effects,
        solver={"dt": 1 / STRETCHES, "unstable_equilibrium": "keep"},
        run={"duration": 1.0, "frames_per_second": STRETCHES, "forces": True},
    )
    with tempfile.TemporaryDirectory(prefix="clothsim-") as folder:
        run = clothsim.simulate(scene, folder, overwrite=True)
        forces, x = run.forces().pins["pins.group[1]"][:, 0], run.positions(-1)
    middle = np.abs(x[:, 0] - x[:, 0].mean()) < 0.1 * np.ptp(x[:, 0])
    width = float(np.ptp(x[middle, 1]) / pulls.width)
    return Compared(pulls.name, ways, forces, pulls.at(ways), width, float(np.nanmean(pulls.at(ways, "widths")[:, -1])))


def compared_knits(folder: Path) -> list[Compared]:
    """Every knit in both directions."""
    pulls = {each.name: each for each in measured_pulls(folder)}
    found = []
    for name, own in pulls.items():
        other = f"{name[:-1]}{'y' if name.endswith('x') else 'x'}"
        found.append(compared(own, table_of(pulls.get(other, own))))
    return found
