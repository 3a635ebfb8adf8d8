"""A8, the wrinkles of a strip whose long sides are moved against each other: their length and direction."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.keys.fabric import Fabric
from clothsim.mesh.generators.shapes import rectangle
from clothsim.mesh.world import World, make_world
from clothsim.physics.energies.base import Energy, Off
from tests.known_answers.plates import flat
from tests.known_answers.row import Outcome, Row
from tests.known_answers.unit_solver import equilibrium, held, those_on
from tests.support.effect_builders import bending, membrane

NU, LENGTH = 0.3, 2.0
"""Poisson's ratio; length of the strip over its height, which is 1."""
LINES = 800
"""Places along a line at which the height is read."""


@dataclass(frozen=True)
class Sheared:
    """A sheared strip at rest: places at rest (n, 2) and now (n, 3) over its height, triangles; its energy over E2."""

    rest: Floats
    places: Floats
    triangles: Ints
    energy: float

    def along(self, height: float) -> tuple[Floats, Floats]:
        """x and z of the line at a height at rest, without a sixth of the strip at each end, where it is slack."""
        from matplotlib.tri import LinearTriInterpolator, Triangulation

        mesh = Triangulation(*self.rest.T, self.triangles)
        q = np.linspace(LENGTH / 6, 5 * LENGTH / 6, LINES)
        x, z = (np.asarray(LinearTriInterpolator(mesh, self.places[:, k])(q, 0 * q + height)) for k in (0, 2))
        return x, z

    def crossings(self, height: float = 0.5) -> Floats:
        """Intersection of that line with the strip's plane."""
        x, z = self.along(height)
        k = np.flatnonzero(z[:-1] * z[1:] < 0)
        return np.asarray(x[k] - z[k] * (x[k + 1] - x[k]) / (z[k + 1] - z[k]), np.float64)

    @property
    def amplitude(self) -> float:
        """The largest |z| of the middle line."""
        return float(np.abs(self.along(0.5)[1]).max())

    @property
    def degrees(self) -> float:
        """Direction of the wrinkles: how far the pattern has moved from .4 to .6 of the height."""
        low, high = self.crossings(0.4), self.crossings(0.6)
        shifts = np.array([high[np.abs(high - place - 0.2).argmin()] - place for place in low])
        return float(np.degrees(np.arctan2(0.2, np.median(shifts))))

    @property
    def half_wavelength(self) -> float:
        """Across the wrinkles, which run at 45 degrees; infinite where there are none."""
        gaps = np.diff(self.crossings())
        return float(gaps.mean() * np.sin(np.pi / 4)) if len(gaps) else np.inf


def half_wavelength(thickness: float, shear: float) -> float:
    """sqrt(pi H t)/[3 (1 - nu^2) gamma]^(1/4), H = 1 (Wong & Pellegrino 2006, part III)."""
    return float(np.sqrt(np.pi * thickness) / (3 * (1 - NU**2) * shear) ** 0.25)


def thickness_of(wavelength: float, shear: float) -> float:
    """The thickness whose half-wavelength that is."""
    return float(wavelength**2 * np.sqrt(3 * (1 - NU**2) * shear) / np.pi)


def strip(thickness: float, cells: int, diagonals: str = "right") -> World:
    """A strip of E2 = 1 with `cells` over its height."""
    positions, triangles = rectangle((LENGTH, 1.0), (round(cells * LENGTH), cells), diagonals)
    fabric = Fabric(1.0, 1.0, 1.0, NU, thickness**2 / (12 * (1 - NU**2)))
    return make_world([flat(positions[:, :2] + [LENGTH / 2, 0.5], triangles, fabric)])


def sheared(world: World, sheet: Energy | Off, shear: float, seed: int = 0) -> Sheared:
    """Its upper side moved along by `shear` (with its sign; over H), from a start off the plane by 1e-4 at random."""
    x = world.start()
    rest = x[:, :2].copy()
    x[:, 0] += shear * x[:, 1]
    sides = (rest[:, 1] < 1e-9) | (rest[:, 1] > 1 - 1e-9)
    x[~sides, 2] += 1e-4 * np.random.default_rng(seed).standard_normal(int((~sides).sum()))
    energies = those_on(membrane=sheet, bending=bending(world, model="midedge"))
    target = held(x, np.flatnonzero(sides))
    x = equilibrium(world, energies, x, target, tolerance=1e-6, max_iterations=400, linear="auto")
    if shear < 0:  # seen in the mirror, so that the wrinkles rise to the right
        rest, x = rest * [-1, 1] + [LENGTH, 0], x * [-1, 1, 1] + [LENGTH, 0, 0]
    return Sheared(rest, x, world.triangles, sum(energy.value(x) for energy in energies.values()))


@lru_cache
def wrinkled(shear: float, wavelength: float, cells: int = 20, seed: int = 0) -> Sheared:
    """The strip whose half-wavelength the theory says to be that, its diagonals along the wrinkles."""
    world = strip(thickness_of(wavelength, shear), cells)
    return sheared(world, membrane(world), shear, seed)


# --- the rows -------------------------------------------------------------------------------------------------------


def _wavelength(shear: float, wavelength: float) -> Outcome:
    """The mean of three starts. The formula is an estimate that takes a wave to be as high as the strip."""
    found = np.mean([wrinkled(shear, wavelength, seed=seed).half_wavelength for seed in range(3)])
    return Outcome(float(found), half_wavelength(thickness_of(wavelength, shear), shear), 0.15)


ROWS = (
    Row("A8a", "wrinkles of a sheared strip, gamma 0.02: half-wavelength / H", lambda: _wavelength(0.02, 0.2)),
    Row(
        "A8b",
        "the same strip: direction of the wrinkles",
        lambda: Outcome(wrinkled(0.02, 0.2).degrees, 45.0, 5.0, unit="degrees"),
    ),
    Row("A8c", "strip 1.8 times as thick, gamma 0.04: half-wavelength / H", lambda: _wavelength(0.04, 0.225)),
)
