"""A2, catenary: a strip without bending between two level supports."""

from functools import partial

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import ClothsimError
from clothsim.keys.fabric import Fabric
from clothsim.mesh.world import make_world
from clothsim.physics.energies.neo_hookean_membrane import NeoHookeanMembrane
from tests.known_answers.row import Outcome, Row
from tests.known_answers.unit_meshes import cloth, grid
from tests.known_answers.unit_solver import equilibrium, held, those_on
from tests.support.effect_builders import gravity

WIDTH = 0.05
SPAN = 1.0
WEIGHT = 1.0
"""Weight per area [N/m2] of a strip of density 1 kg/m2 in a field of 1 m/s2."""


def catenary(length: float) -> Floats:
    """H/W, sag/L, end angle [degrees] of z = a cosh(x/a): 2 a sinh(S/2a) = L, H = w a, tan(angle) = sinh(S/2a)."""
    from scipy.optimize import brentq

    a = brentq(lambda a: 2 * a * np.sinh(SPAN / (2 * a)) - length, 0.05, 50, xtol=1e-15)
    u = SPAN / (2 * a)
    return np.array([a / length, a * (np.cosh(u) - 1) / length, np.degrees(np.arctan(np.sinh(u)))])


def hanging(length: float, cells: int) -> Floats:
    """H/W, sag/L and end angle [degrees] of a strip that starts on a parabola, flat across.

    ClothsimError where its supports do not carry its weight.
    """
    fabric = Fabric(WEIGHT, 1.0, 1e6 * WEIGHT * length, 0.0, 0.0)
    positions, triangles = grid(cells, 1, length, WIDTH)
    world = make_world([cloth(positions, triangles, fabric)])
    energies = those_on(membrane=NeoHookeanMembrane.of(world), gravity=gravity(world, acceleration=(0.0, 0.0, -1.0)))
    start = positions.copy()
    s = positions[:, 0] / length
    start[:, 0] = s * SPAN
    start[:, 2] = -4 * catenary(length)[1] * length * s * (1 - s)
    ends = np.flatnonzero((s == 0) | (s == 1))
    x = equilibrium(world, energies, start, held(start, ends), tolerance=1e-8, max_iterations=300)
    force = np.sum([energy.gradient(x) for energy in energies.values()], axis=0)
    weight = WEIGHT * length * WIDTH
    if np.abs(force[ends].sum(axis=0) - [0, 0, weight]).max() > 1e-6 * weight:
        raise ClothsimError("The supports of the catenary do not carry its weight.")
    H, V = np.abs(force[s == 0].sum(axis=0)[[0, 2]])
    return np.array([H / weight, -x[:, 2].min() / length, np.degrees(np.arctan2(V, H))])


DIGITS = {1.25: ("0.33820188", "0.26543751", "55.9254"), 1.5: ("0.20549098", "0.33508884", "67.6582")}
ASKED = ("horizontal pull / weight", "sag / length", "end angle [degrees]")


def _row(ratio: float, k: int) -> Outcome:
    exact = catenary(ratio * SPAN)[k]
    coarse, fine = (hanging(ratio * SPAN, cells)[k] for cells in (10, 20))
    order = float(np.log2(abs((coarse - exact) / (fine - exact))))
    return Outcome(fine, exact, 2e-3, printed=DIGITS[ratio][k], order=order, orders=(1.8, 2.2))


ROWS = tuple(
    Row(f"A2{'abcdef'[3 * j + k]}", f"catenary, L/S = {ratio}: {asked}", partial(_row, ratio, k))
    for j, ratio in enumerate(DIGITS)
    for k, asked in enumerate(ASKED)
)
