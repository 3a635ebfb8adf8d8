"""A motion with one solution, for orders in time: the same masses and membrane integrated by an explicit method."""

from dataclasses import replace

import numpy as np
from meshes import cloth, irregular_grid, random_rotation
from scipy.integrate import solve_ivp

from clothsim.energies.inertia import inertia
from clothsim.energies.membrane import membrane
from clothsim.mesh.world import make_world


def ringing():
    """A strained sheet of 4 triangles: world, energies, and where it is at 0.8 s by a method of order 8, (n, 3)."""
    rest, triangles = irregular_grid(nx=2, ny=1)
    start = rest @ np.diag([1.25, 0.9, 1.0]) @ random_rotation(2).T
    world = make_world([replace(cloth(rest, triangles), positions=start)])
    energies = {"inertia": inertia(world), "membrane": membrane(world)}
    n = start.size

    def rate(t, y):
        force = -energies["membrane"].gradient(y[:n].reshape(-1, 3))
        return np.concatenate([y[n:], (force / world.masses[:, None]).ravel()])

    begin = np.concatenate([start.ravel(), np.zeros(n)])
    exact = solve_ivp(rate, (0, 0.8), begin, method="DOP853", rtol=1e-11, atol=1e-12).y[:n, -1].reshape(-1, 3)
    assert np.abs(exact - start).max() > 0.05
    return world, energies, exact
