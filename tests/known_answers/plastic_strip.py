"""A cantilever that its weight bends beyond the yield, then unloaded: the tip that is left, of beam theory.

The moment over D at the distance s from the tip is a s^2, a = rho_A g/(2 D). Beyond the yield y the curvature has the
plastic part (a s^2 - y)/H, which unloading leaves where it is below y/H; with s0^2 = y/a its tip is down by

    int_s0^L (a s^2 - y) s/H ds = [a (L^4 - s0^4)/4 - y (L^2 - s0^2)/2]/H.
"""

from dataclasses import replace

import numpy as np

from clothsim.base.errors import ClothsimError
from clothsim.keys.fabric import Fabric
from clothsim.mesh.world import make_world
from clothsim.physics.energies.pins import clamped
from clothsim.solve.linear.linear_system import System
from clothsim.solve.newton.newton import Newton, NewtonSettings
from clothsim.solve.newton.potential import Potential
from clothsim.solve.timers import Timers
from tests.known_answers.plates import MEMBRANE, flat
from tests.known_answers.strips import lattice_strip
from tests.known_answers.unit_solver import held, pattern_of, step_at, those_on
from tests.support.effect_builders import bending, gravity, membrane, plastic_bending

WEIGHT, YIELD, HARDENING = 0.05, 0.015, 0.5
"""rho_A g L^3/D, y L and H: at the clamp 0.02 of plastic curvature, below y/H. A weight four times as large bends it so
far that the tip stays 0.2 % higher than that of beam theory."""
MESHES = (10, 40)
"""Cells along it that give the order: between a mesh and the next the place of the yield's front in its cell
matters more, and the error of one may be below that of a finer one."""


def tip_left(steps: int, model: str = "midedge", cells: int = 20) -> float:
    """How far down the tip stays, over the length, by `steps` equal steps of the load up and as many down."""
    points, triangles = lattice_strip(cells, 0)
    pinned = np.flatnonzero(points[:, 0] < 1e-9)
    fabric = Fabric(density=1.0, thickness=1.0, youngs_modulus=MEMBRANE, poisson_ratio=0.0, bending_stiffness=1.0)
    world, (ghosts,) = clamped(make_world([flat(points, triangles, fabric)]), [pinned])
    x, memory = world.start(), {}
    target = held(x, np.concatenate([pinned, ghosts]))
    stiff = bending(world, model=model)
    flow = plastic_bending(world, yield_curvature=YIELD, hardening=HARDENING, built={"bending": stiff})
    up = np.arange(1, steps + 1) / steps
    for fraction in [*up, *up[-2::-1], 0.0]:
        weight = gravity(world, acceleration=(0.0, 0.0, -WEIGHT * float(fraction)))
        energies = those_on(membrane=membrane(world), bending=stiff, gravity=weight, plastic_bending=flow)
        potential = Potential(energies, Timers()).begin(replace(step_at(x), memory=memory))
        system = System(pattern_of(world, energies, x), "auto")
        system.begin(potential.couplings(x, np.zeros_like(x)))
        result = Newton(potential, system, NewtonSettings(tolerance=1e-9, max_iterations=400), 1.0).minimise(x, target)
        if not result.outcome.converged:
            raise ClothsimError(f"No equilibrium was found: {result.outcome.sentence}")
        x, memory = result.x, potential.memory()
    return float(-x[: len(points)][points[:, 0] > 1 - 1e-9, 2].mean())


def tip_of_beam() -> float:
    """The same of the beam."""
    a, start = WEIGHT / 2, YIELD / (WEIGHT / 2)
    return float((a * (1 - start**2) / 4 - YIELD * (1 - start) / 2) / HARDENING)
