"""Plates that are known exactly, with any bending model on any mesh: a hanging strip and a loaded ring (VALIDATION A3).

The strip is free at its sides, nu = 0. Its membrane is that of a sheet of 1/40 of its length, E t L^2/D = 2e4: its own
stretch adds 0.1 % at the largest weight. A membrane that is five times stiffer locks on the strip that is cut at 135
degrees, whose cells cannot bend without stretch: -1.3 % at 40 cells and Gamma 100, 0.0 % at 80. That is no error of
bending, and it is not wanted here.
"""

from functools import lru_cache

import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.energies.base import ElementHessian, Energy, Prescribed, Step
from clothsim.energies.bending import bending
from clothsim.energies.gravity import gravity
from clothsim.energies.membrane import membrane
from clothsim.errors import ClothsimError
from clothsim.mesh.clamp import clamped
from clothsim.mesh.cloth import Cloth, make_cloth
from clothsim.mesh.fabric import Fabric
from clothsim.mesh.world import World, make_world
from clothsim.solve.ledger import Ledger
from clothsim.solve.newton import Newton, NewtonSettings
from clothsim.solve.pattern import make_pattern
from clothsim.solve.potential import Potential
from clothsim.solve.system import System

MEMBRANE = 2e4
LOADS = {100: (0.1, 0.3, 1.0)}
"""Shares of the weight that are laid on one after the other; all at once where nothing is said."""
INNER, OUTER, NU, DEFLECTION = 0.6, 1.0, 0.3, 0.00350753
"""The ring: its radii, Poisson's ratio, and w D/(q b^4) at its outer border under an even load q."""


def drooped(points: Floats, triangles: Ints, model: str, gamma: float) -> float:
    """Tip drop over tip reach of a strip 0 <= x <= 1 that hangs from a clamp at x = 0; gamma = rho_A g L^3/D."""
    pinned = np.flatnonzero(points[:, 0] < 1e-9)
    fabric = Fabric(density=1.0, thickness=1.0, youngs_modulus=MEMBRANE, poisson_ratio=0.0, bending_stiffness=1.0)
    world, (ghosts,) = clamped(make_world([flat(points, triangles, fabric)]), [pinned])
    x = world.start()
    rows = np.concatenate([pinned, ghosts])
    for share in LOADS.get(int(gamma), (1.0,)):
        named = {
            "membrane": membrane(world),
            "bending": bending(world, model=model),
            "gravity": gravity(world, acceleration=(0.0, 0.0, -gamma * share)),
        }
        energies = {name: energy for name, energy in named.items() if isinstance(energy, Energy)}
        x = _at_rest(world, energies, x, Prescribed(rows, world.start()[rows]))
    tip = x[: len(points)][points[:, 0] > 1 - 1e-9].mean(axis=0)
    return float(-tip[2] / tip[0])


@lru_cache
def elastica(gamma: float) -> float:
    """Drop over reach of the tip: B theta'' = -gamma r cos theta, r from the tip, theta the slope down.

    Shooting for the slope at the tip, where the moment vanishes; the slope at the clamp is 0.
    """
    from scipy.integrate import solve_ivp
    from scipy.optimize import brentq

    def shoot(slope: float) -> Floats:
        def rates(r: float, y: Floats) -> list[float]:
            return [y[1], -gamma * r * np.cos(y[0]), np.cos(y[0]), np.sin(y[0])]

        return solve_ivp(rates, (0, 1), [slope, 0, 0, 0], method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]

    _, _, reach, drop = shoot(brentq(lambda slope: shoot(slope)[0], 0, np.pi / 2, xtol=1e-14))
    return float(drop / reach)


def ring_deflection(points: Floats, triangles: Ints, model: str) -> float:
    """w D/(q b^4) of the outer border of a ring that is clamped inside, small deflections: one linear solve."""
    from scipy.sparse.linalg import spsolve

    radius = np.linalg.norm(points, axis=1)
    pinned = np.flatnonzero(radius < INNER + 1e-9)
    fabric = Fabric(density=1.0, thickness=1.0, youngs_modulus=1.0, poisson_ratio=NU, bending_stiffness=1.0)
    world, _ = clamped(make_world([flat(points, triangles, fabric)]), [pinned])
    energy = bending(world, model=model)
    hessian = energy.hessian(world.start()) if isinstance(energy, Energy) else None
    if not isinstance(hessian, ElementHessian):
        raise ClothsimError(f"{model} has no element Hessian.")
    free = np.setdiff1d(np.arange(len(points)), pinned)
    across = hessian.to_sparse(world.n_vertices)[2::3][:, 2::3][free][:, free]
    w = np.zeros(len(points))
    w[free] = spsolve(across.tocsc(), world.vertex_areas[free])
    return float(w[radius > OUTER - 1e-9].mean())


def flat(points: Floats, triangles: Ints, fabric: Fabric) -> Cloth:
    """A cloth of flat `points (n, 2)` [m] in z = 0."""
    return make_cloth("plate", np.column_stack([points, np.zeros(len(points))]), triangles, fabric)


def _at_rest(world: World, energies: dict[str, Energy], x: Floats, target: Prescribed) -> Floats:
    """Where the energies have their minimum, from x, to a millionth of the length."""
    zero = np.zeros_like(x)
    step = Step(time=0.0, dt=1.0, positions=x, velocities=zero, load=1.0, gradient=zero)
    system = System(make_pattern(world.n_cloth, world.triangles, [energy.hessian(x) for energy in energies.values()]))
    newton = Newton(Potential(energies, Ledger()).begin(step), system, NewtonSettings(1e-6, 400), 1.0)
    result = newton.minimise(x, target)
    if not result.outcome.converged:
        raise ClothsimError(f"A strip did not come to rest: {result.outcome.sentence}")
    return result.x
