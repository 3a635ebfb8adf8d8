"""A strip hangs under its own weight, free to narrow: the drop of its lower end (VALIDATION A1)."""

import numpy as np
import pytest
from meshes import cloth, grid
from scipy.integrate import quad
from scipy.optimize import brentq
from solving import equilibrium, held

from clothsim.energies.gravity import gravity
from clothsim.energies.membrane import membrane
from clothsim.mesh.fabric import Fabric
from clothsim.mesh.world import make_world

MU, LAM = 1.0, 1.5
WIDTH = 0.02


def stretches(tension):
    """(l1, l2) of a strip that carries P1 = `tension` with free sides."""

    def stress(l1, l2):
        return MU * (l1 - 1 / l1) + LAM * np.log(l1 * l2) / l1

    def width(l1):
        return brentq(lambda l2: stress(l2, l1), 0.2, 1.5, xtol=1e-15)

    l1 = brentq(lambda l: stress(l, width(l)) - tension, 1 - 1e-9, 3, xtol=1e-15)
    return l1, width(l1)


def drop(weight):
    """delta / L: the section at s from the top carries the weight below it."""
    return quad(lambda s: stretches(weight * (1 - s))[0] - 1, 0, 1, epsabs=1e-11)[0]


def simulated_drop(weight, cells):
    """The drop of a strip of length 1 whose top is held at the width that it has in the solution."""
    fabric = Fabric(weight, 1.0, 4 * MU * (LAM + MU) / (LAM + 2 * MU), LAM / (LAM + 2 * MU), 0.0)
    positions, triangles = grid(1, cells, WIDTH, 1.0)
    world = make_world([cloth(positions, triangles, fabric)])
    energies = {"membrane": membrane(world), "gravity": gravity(world, acceleration=(0.0, -1.0, 0.0))}
    start = positions * [stretches(weight)[1], 1.0, 1.0]
    top = np.flatnonzero(positions[:, 1] == 1.0)
    x = equilibrium(world, energies, start, held(start, top), tolerance=1e-10)
    assert np.abs(x[:, 2]).max() == 0
    force = energies["membrane"].gradient(x)[top].sum(axis=0)
    carried = weight * WIDTH - world.masses[top].sum()
    assert force == pytest.approx([0, carried, 0], rel=1e-8, abs=1e-8 * carried)
    bottom = positions[:, 1] == 0.0
    return -x[bottom, 1].mean()


@pytest.mark.parametrize(("weight", "digits"), [(0.5, 0.09683185), (1.0, 0.21438245)])
def test_hanging_strip(weight, digits):
    exact = drop(weight)
    assert exact == pytest.approx(digits, abs=6e-9)
    errors = np.array([simulated_drop(weight, cells) - exact for cells in (8, 16, 32)])
    assert abs(errors[-1]) < 1e-3 * exact
    assert np.log2(abs(errors[-2] / errors[-1])) > 1.8
