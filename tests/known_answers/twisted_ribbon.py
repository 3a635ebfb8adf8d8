"""Torque and buckling of a twisted ribbon (Green 1936, 1937): Foppl-von Karman equations about the helicoid.

A ribbon of width 1, D = 1, nu = 0, E2 = E, with a twist t a length and the mean line stretched by e: tension
E (e + t^2 y^2/2), torque 2 t + E t^3/160 + E e t/12. At small tension the middle is compressed. A deflection
f(y) cos k x with the Airy function g(y) sin k x obeys

    f'''' - 2 k^2 f'' + k^4 f + k^2 E (e + t^2 y^2/2) f + 2 t k g' = 0,    g'''' - 2 k^2 g'' + k^4 g + 2 E t k f' = 0,

free at y = +- 1/2 (g = g' = 0). Galerkin's method with polynomials; g is eliminated.
"""

from functools import lru_cache

import numpy as np
from numpy.polynomial import Legendre
from scipy import sparse

from clothsim.base.arrays import Floats
from clothsim.keys.fabric import Fabric
from clothsim.mesh.generators.shapes import rectangle
from clothsim.mesh.world import World, make_world
from clothsim.physics.energies.base import Energy
from tests.known_answers.unit_meshes import cloth
from tests.known_answers.unit_solver import equilibrium, held, second_derivatives, those_on
from tests.support.effect_builders import bending, membrane

THIN, TWIST, LENGTH = 4e5, 0.1, 8.0
"""Of the ribbon that buckles: E2 b^2/D with its width b (b/t = 180), rad a width, and widths: four waves. The equations
are those of slight twists: with 0.2, and E2 a quarter of it, the mesh's limit is 0.24 % further away from them."""
MODULUS, SLIGHT, SHORT = 1e5, 0.05, 4.0
"""Of the one whose torque is asked for, half of it by bending."""
LOADED = 0.8, 0.9
"""Fractions of the critical stretch at which the second derivatives are taken."""
DEGREE = 16
"""Polynomials of f and g."""


# --- the ribbon on a mesh -------------------------------------------------------------------------------------------


def at_rest(
    cells: int, length: float, twist: float, stretch: float, model: str, modulus: float
) -> tuple[World, dict[str, Energy], Floats, np.ndarray]:
    """A ribbon `cells` wide whose ends are turned and brought nearer: world, energies, positions, ends (rows of x)."""
    fabric = Fabric(1.0, 1.0, modulus, 0.0, 1.0)
    positions, triangles = rectangle((length, 1.0), (int(length * cells), cells))
    world = make_world([cloth(positions, triangles, fabric)])
    rest = world.start()
    turn = twist * rest[:, 0]
    x = np.column_stack([rest[:, 0] * (1 + stretch), rest[:, 1] * np.cos(turn), rest[:, 1] * np.sin(turn)])
    ends = np.flatnonzero(np.abs(rest[:, 0]) > length / 2 - 1e-9)
    energies = those_on(membrane=membrane(world), bending=bending(world, model=model))
    x = equilibrium(world, energies, x, held(x, ends), tolerance=1e-9, max_iterations=200, linear="auto")
    return world, energies, x, ends


@lru_cache
def ribbon_torque(cells: int, model: str) -> float:
    """Torque over 2 D of a ribbon with a SLIGHT twist and no stretch of its mean line."""
    _, energies, x, ends = at_rest(cells, SHORT, SLIGHT, 0.0, model, MODULUS)
    force = np.sum([energy.gradient(x) for energy in energies.values()], axis=0)
    end = ends[x[ends, 0] > 0]
    return float((x[end, 1] * force[end, 2] - x[end, 2] * force[end, 1]).sum() / 2)


@lru_cache
def buckling_stretch(cells: int, model: str) -> float:
    """The stretch at which the ribbon's second derivatives turn singular, extrapolated from those at LOADED."""
    from scipy.sparse.linalg import eigsh

    critical = critical_stretch(THIN, TWIST)[0]
    first, second = (_stiffness(cells, fraction * critical, model) for fraction in LOADED)
    largest = eigsh(first - second, k=1, M=first, which="LA", return_eigenvectors=False)[0]
    return float(critical * (LOADED[0] + (LOADED[1] - LOADED[0]) / largest))


def _stiffness(cells: int, stretch: float, model: str) -> sparse.csc_array:
    """Second derivatives by the free vertices."""
    world, energies, x, ends = at_rest(cells, LENGTH, TWIST, stretch, model, THIN)
    free = np.setdiff1d(np.arange(world.n_cloth), ends)
    rows = (3 * free[:, None] + np.arange(3)).ravel()
    total = sparse.csr_array((x.size, x.size))
    for energy in energies.values():
        total = total + second_derivatives(energy, x)
    return total.tocsr()[rows][:, rows].tocsc()


# --- the equations --------------------------------------------------------------------------------------------------


def helicoid_torque() -> float:
    """Torque over 2 D of that with a SLIGHT twist."""
    return SLIGHT + MODULUS * SLIGHT**3 / 320


def critical_stretch(modulus: float, twist: float) -> tuple[float, float]:
    """The stretch e < 0 of the mean line at which the ribbon buckles, and the wave number k of its mode."""
    from scipy.optimize import minimize_scalar

    scan = np.geomspace(1.0, 30.0, 60)
    first = scan[np.argmin([_load(modulus, twist, k) for k in scan])]
    found = minimize_scalar(
        lambda k: _load(modulus, twist, k), bounds=(0.9 * first, 1.1 * first), method="bounded", options={"xatol": 1e-8}
    )
    return -float(found.fun), float(found.x)


def _load(modulus: float, twist: float, k: float) -> float:
    """The least -e of the waves k."""
    from scipy.linalg import eigh, solve

    nodes, weights = np.polynomial.legendre.leggauss(2 * DEGREE)
    y, w = nodes / 2, weights / 2
    free = [Legendre.basis(j) for j in range(DEGREE)]
    f = _derivatives(free, nodes)
    g = _derivatives([Legendre([2 / 3, 0, -2 / 3]) ** 2 * one for one in free], nodes)
    plate, airy = ((h[2] * w) @ h[2].T + 2 * k**2 * (h[1] * w) @ h[1].T + k**4 * (h[0] * w) @ h[0].T for h in (f, g))
    source = (g[0] * w) @ f[1].T
    stretched = modulus * k**2 * (f[0] * w * twist**2 * y**2 / 2) @ f[0].T
    curved = 4 * modulus * twist**2 * k**2 * source.T @ solve(airy, source, assume_a="pos")
    mass = modulus * k**2 * (f[0] * w) @ f[0].T
    return float(eigh(plate + stretched + curved, mass, subset_by_index=(0, 0))[0][0])


def _derivatives(functions: list[Legendre], nodes: Floats) -> list[Floats]:
    """Values and the first two derivatives by y = nodes/2, each (functions, nodes)."""
    return [np.array([2**d * one.deriv(d)(nodes) if d else one(nodes) for one in functions]) for d in range(3)]
