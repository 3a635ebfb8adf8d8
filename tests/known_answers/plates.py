"""Hanging strip and loaded ring, exact for any bending model on any mesh (docs/results/validation.md, A3).

The strip is free at its sides, nu = 0. Its membrane is that of a sheet of 1/40 of its length, E t L^2/D = 2e4: its own
stretch adds 0.1 % at the largest weight. A membrane that is five times stiffer locks on the strip that is cut at 135
degrees, whose cells cannot bend without stretch: -1.3 % at 40 cells and Gamma 100, 0.0 % at 80. That is no error of
bending, and it is not wanted here.
"""

from dataclasses import replace

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.keys.fabric import Fabric
from clothsim.mesh.cloth import Cloth, make_cloth
from clothsim.mesh.world import make_world
from clothsim.physics.energies.pins import clamped
from tests.known_answers.elastica import hanging_cantilever, loaded_ring
from tests.known_answers.unit_solver import equilibrium, held, second_derivatives, those_on
from tests.support.effect_builders import bending, gravity, membrane

MEMBRANE = 2e4
LOADS = {100: (0.1, 0.3, 1.0)}
"""Shares of the weight that are laid on one after the other; all at once where nothing is said."""
INNER, OUTER, NU = 0.6, 1.0, 0.3
"""The ring: its radii and Poisson's ratio."""
DEFLECTION = loaded_ring(INNER, OUTER, NU)
"""w D/(q b^4) at its outer border under an even load q."""


def drooped(
    points: Floats, triangles: Ints, model: str, gamma: float, warp_degrees: float = 0.0, **bending_along: float
) -> float:
    """Tip drop over tip reach of a strip 0 <= x <= 1 that hangs from a clamp at x = 0; gamma = rho_A g L^3/D.

    warp_degrees: angle of the warp; bending_along: bending stiffnesses of the fabric over D, by `Fabric`'s names.
    """
    pinned = np.flatnonzero(points[:, 0] < 1e-9)
    fabric = Fabric(density=1.0, thickness=1.0, youngs_modulus=MEMBRANE, poisson_ratio=0.0, bending_stiffness=1.0)
    fabric = replace(fabric, **bending_along)
    world, (ghosts,) = clamped(make_world([flat(points, triangles, fabric)]), [pinned])
    x = world.start()
    rows = np.concatenate([pinned, ghosts])
    stiff = bending(world, model=model, angle_degrees=warp_degrees)
    for fraction in LOADS.get(int(gamma), (1.0,)):
        weight = gravity(world, acceleration=(0.0, 0.0, -gamma * fraction))
        energies = those_on(membrane=membrane(world), bending=stiff, gravity=weight)
        target = held(world.start(), rows)
        x = equilibrium(world, energies, x, target, tolerance=1e-6, max_iterations=400, linear="auto")
    tip = x[: len(points)][points[:, 0] > 1 - 1e-9].mean(axis=0)
    return float(-tip[2] / tip[0])


def elastica(gamma: float) -> float:
    """Drop over reach of the tip of such a strip."""
    reach, drop = hanging_cantilever(gamma)
    return drop / reach


def ring_deflection(points: Floats, triangles: Ints, model: str) -> float:
    """w D/(q b^4) of the outer border of a ring that is clamped inside, small deflections: one linear solve."""
    from scipy.sparse.linalg import spsolve

    radius = np.linalg.norm(points, axis=1)
    pinned = np.flatnonzero(radius < INNER + 1e-9)
    fabric = Fabric(density=1.0, thickness=1.0, youngs_modulus=1.0, poisson_ratio=NU, bending_stiffness=1.0)
    world, _ = clamped(make_world([flat(points, triangles, fabric)]), [pinned])
    free = np.setdiff1d(np.arange(len(points)), pinned)
    across = second_derivatives(bending(world, model=model), world.start())[2::3][:, 2::3][free][:, free]
    w = np.zeros(len(points))
    w[free] = spsolve(across.tocsc(), world.vertex_areas[free])
    return float(w[radius > OUTER - 1e-9].mean())


def flat(points: Floats, triangles: Ints, fabric: Fabric) -> Cloth:
    """A cloth of flat `points (n, 2)` [m] in z = 0."""
    return make_cloth("plate", np.column_stack([points, np.zeros(len(points))]), triangles, fabric)
