"""A strip without bending between two level supports hangs as a catenary (VALIDATION A2)."""

import numpy as np
import pytest
from meshes import cloth, grid
from scipy.optimize import brentq
from solving import equilibrium, held

from clothsim.energies.gravity import gravity
from clothsim.energies.membrane import membrane
from clothsim.mesh.fabric import Fabric
from clothsim.mesh.world import make_world

WIDTH = 0.05
SPAN = 1.0
WEIGHT = 1.0
"""Weight per area [N/m2] of a strip of density 1 kg/m2 in a field of 1 m/s2."""


def catenary(length):
    """H/W, sag/L, end angle of z = a cosh(x/a): 2 a sinh(S/2a) = L, H = w a, tan(angle) = sinh(S/2a)."""
    a = brentq(lambda a: 2 * a * np.sinh(SPAN / (2 * a)) - length, 0.05, 50, xtol=1e-15)
    u = SPAN / (2 * a)
    return a / length, a * (np.cosh(u) - 1) / length, np.degrees(np.arctan(np.sinh(u)))


def hanging(length, cells):
    """H/W, sag/L and end angle of a strip that starts on a parabola, flat across."""
    fabric = Fabric(WEIGHT, 1.0, 1e6 * WEIGHT * length, 0.0, 0.0)
    positions, triangles = grid(cells, 1, length, WIDTH)
    world = make_world([cloth(positions, triangles, fabric)])
    energies = {"membrane": membrane(world), "gravity": gravity(world, acceleration=(0.0, 0.0, -1.0))}
    start = positions.copy()
    s = positions[:, 0] / length
    start[:, 0] = s * SPAN
    start[:, 2] = -4 * catenary(length)[1] * length * s * (1 - s)
    ends = np.flatnonzero((s == 0) | (s == 1))
    x = equilibrium(world, energies, start, held(start, ends), tolerance=1e-8, max_iterations=300)
    force = sum(energy.gradient(x) for energy in energies.values())
    weight = WEIGHT * length * WIDTH
    assert force.sum(axis=0) == pytest.approx([0, 0, weight], abs=1e-7 * weight)
    assert force[ends].sum(axis=0) == pytest.approx([0, 0, weight], abs=1e-6 * weight)
    H, V = np.abs(force[s == 0].sum(axis=0)[[0, 2]])
    assert pytest.approx(weight / 2, rel=1e-4) == V
    return np.array([H / weight, -x[:, 2].min() / length, np.degrees(np.arctan2(V, H))])


@pytest.mark.parametrize(
    ("ratio", "digits"),
    [(1.25, (0.33820188, 0.26543751, 55.9254)), (1.5, (0.20549098, 0.33508884, 67.6582))],
)
def test_catenary(ratio, digits):
    length = ratio * SPAN
    exact = np.array(catenary(length))
    assert exact == pytest.approx(digits, rel=1e-6)
    coarse, fine = (np.abs(hanging(length, cells) / exact - 1) for cells in (10, 20))
    assert (fine < 2e-3).all()
    assert (np.log2(coarse / fine) > 1.8).all()
