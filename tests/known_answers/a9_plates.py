"""A9, plates, strips and drums with the default bending and membrane: twist, vibration, buckling, a twisted ribbon.

Bending D = 1 and area density 1 over a side or length of 1, so that squared frequencies are the eigenvalues of the
exact Hessian against the lumped masses. A row that names cells is of the default diagonals, "alternating".
"""

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache, partial
from string import ascii_lowercase

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import eigsh

from clothsim.base.arrays import Floats, Ints
from clothsim.keys.fabric import Fabric
from clothsim.mesh.cloth import make_cloth
from clothsim.mesh.generators.shapes import disk, rectangle
from clothsim.mesh.topology import border_vertices
from clothsim.mesh.world import World, make_world
from clothsim.physics.energies.base import Energy, Off
from clothsim.physics.energies.pins import clamped
from clothsim.solve.stepping.state import first_state
from clothsim.solve.stepping.time_loop import steps
from tests.known_answers.elastica import elastica_height
from tests.known_answers.row import Outcome, Row
from tests.known_answers.twisted_ribbon import (
    THIN,
    TWIST,
    buckling_stretch,
    critical_stretch,
    helicoid_torque,
    ribbon_torque,
)
from tests.known_answers.unit_meshes import cloth
from tests.known_answers.unit_solver import integrator_of, pinned, second_derivatives, those_on
from tests.support.effect_builders import bending, membrane

PLATE = Fabric(density=1.0, thickness=1.0, youngs_modulus=1.0, poisson_ratio=0.3, bending_stiffness=1.0)
BEAM = replace(PLATE, poisson_ratio=0.0)
"""The fabric of strips: with nu = 0 a strip of any width is a beam of B = D."""
ORDERS = (1.7, 3.0)
"""Observed orders that pass."""
EULER_CELLS = {"hinged": (40, 80), "clamped": (20, 40)}
SMALL = 1e-6
"""Strain of the strips whose Euler loads are asked for."""
CANTILEVER = (3.4711, 8.5070, 21.2853, 27.1990)
"""omega a^2 sqrt(rho/D) of a square plate clamped at one side, nu = .3 (Leissa 1973, converged series)."""
FREE = (13.468, 19.596, 24.270)
"""Of a free square plate, nu = .3 (the same), after six rigid motions."""
CLAMPED = (35.9852, 73.3938)
"""Of a clamped square plate (the same, one digit more)."""
BEAM_MODES = (3.5160153, 22.034492, 61.697214)
"""Of a cantilever: x^2 with cos x cosh x = -1."""
DRUM_MODES = (2.4048256, 3.8317060, 5.1356223)
"""Of a round drum: the first zeros of J_0, J_1 and J_2."""
DRUM_PLACES = (0, 1, 3)
"""Their places among the eigenvalues: the second and third modes are double."""


def sheet(size: tuple[float, float], cells: tuple[int, int], fabric: Fabric, diagonals: str = "alternating") -> World:
    """A rectangle in z = 0 with its left side at x = 0."""
    positions, triangles = rectangle(size, cells, diagonals)
    return make_world([cloth(positions + np.array([size[0] / 2, 0, 0]), triangles, fabric)])


def bent(world: World, free: Ints, model: str) -> sparse.csc_array:
    """Second derivatives of the bending energy by z of the free vertices."""
    return across(bending(world, model=model), world.start(), free)


def across(energy: Energy | Off, x: Floats, free: Ints) -> sparse.csc_array:
    """Second derivatives of an energy by z of the free vertices."""
    return second_derivatives(energy, x)[3 * free + 2][:, 3 * free + 2].tocsc()


def frequencies(stiffness: sparse.csc_array, masses: Floats, count: int) -> Floats:
    """The lowest angular frequencies."""
    squares = eigsh(stiffness, k=count, M=sparse.diags_array(masses).tocsc(), sigma=-1.0)[0]
    return np.sqrt(np.maximum(np.sort(squares), 0.0))


@lru_cache
def plate_modes(sides: str, cells: int, model: str) -> tuple[float, ...]:
    """Frequencies of the modes of a square plate with nu = .3: its `sides` are "free", "left" or "all" clamped."""
    world = sheet((1, 1), (cells, cells), PLATE)
    x = world.start()[: world.n_cloth]
    at = {"free": np.zeros(len(x), bool), "left": x[:, 0] < 1e-9}
    at["all"] = np.isin(np.arange(len(x)), border_vertices(world.triangles))
    return _modes(world, np.flatnonzero(at[sides]), model, 6 if sides == "free" else 4, rigid=3 * (sides == "free"))


@lru_cache
def beam_modes(cells: int, model: str) -> tuple[float, ...]:
    """Frequencies of the bending modes of a cantilever of 1 x .05, nu = 0."""
    world = sheet((1, 0.05), (cells, 2), BEAM)
    return _modes(world, np.flatnonzero(world.start()[: world.n_cloth, 0] < 1e-9), model, 3)


def _modes(world: World, fixed: Ints, model: str, count: int, rigid: int = 0) -> tuple[float, ...]:
    """The lowest `count` frequencies, less the first `rigid`; `fixed` vertices are clamped."""
    clamped_world = clamped(world, [fixed])[0] if len(fixed) else world
    free = np.setdiff1d(np.arange(world.n_cloth), fixed)
    found = frequencies(bent(clamped_world, free, model), world.masses[free], count)
    return tuple(float(one) for one in found[rigid:])


@lru_cache
def drum_modes(cells: int) -> tuple[float, ...]:
    """Frequencies of a round drum of radius 1 without bending, over sqrt(T/rho), stretched by 1.1 and held at its rim.

    T: the tension along either axis at that stretch, per length at rest and over the stretch.
    """
    positions, triangles = disk(radius=1.0, cells=cells)
    world = make_world([cloth(positions, triangles, PLATE)])
    stretch, mu = 1.1, PLATE.youngs_modulus / 2.6
    lame = PLATE.youngs_modulus * 0.3 / (1 - 0.3**2)
    tension = (mu * (stretch - 1 / stretch) + lame * np.log(stretch**2) / stretch) / stretch
    x = world.start() * [stretch, stretch, 1]
    free = np.setdiff1d(np.arange(world.n_cloth), border_vertices(triangles))
    found = frequencies(across(membrane(world), x, free), world.masses[free], 6) / np.sqrt(tension)
    return tuple(float(one) for one in found[list(DRUM_PLACES)])


@lru_cache
def euler_load(cells: int, ends: str, model: str) -> float:
    """P L^2/B per width at which a strip of 1 x .05, nu = 0, pressed along its length buckles: ends clamped or hinged.

    The stresses of the membrane under a strain of SMALL are its stiffness out of the plane.
    """
    world = sheet((1, 0.05), (cells, max(2, cells // 20)), BEAM)
    rest = world.start()
    ends_of = np.flatnonzero((rest[:, 0] < 1e-9) | (rest[:, 0] > 1 - 1e-9))
    free = np.setdiff1d(np.arange(world.n_cloth), ends_of)
    pressed = rest * [1 - SMALL, 1, 1]
    thrust = -across(membrane(world), pressed, free) / (BEAM.youngs_modulus * SMALL)
    left, right = (ends_of[(rest[ends_of, 0] > 0.5) == far] for far in (False, True))
    held_world = clamped(world, [left, right])[0] if ends == "clamped" else world
    largest = eigsh(thrust, k=1, M=bent(held_world, free, model), which="LA", return_eigenvectors=False)[0]
    return float(1 / largest)


@lru_cache
def buckled_height(cells: int, model: str) -> float:
    """Height over length of a strip of 1 x .1 with hinged ends, pressed flat to .8 of its length, at rest."""
    positions, triangles = rectangle((1, 0.1), (cells, 2))
    rest = positions + np.array([0.5, 0, 0])
    fabric, pressed = replace(BEAM, youngs_modulus=1e5), rest * [0.8, 1, 1]
    strip = make_cloth("strip", rest, triangles, fabric, positions=pressed)
    held_there = np.flatnonzero(np.abs(positions[:, 0]) > 0.5 - 1e-9).tolist()
    world, ends = pinned(make_world([strip]), select=held_there)
    energies = those_on(membrane=membrane(world), bending=bending(world, model=model))
    integrator = integrator_of(world, energies, 0.02, {"pins": ends}, tolerance=1e-6)
    reports = list(steps(integrator, first_state(world, 0.02), 1.0, 10.0, "rest"))
    return float(np.abs(reports[-1].state.positions[:, 2]).max())


# --- the rows -------------------------------------------------------------------------------------------------------


def _refined(of: Callable[[int, str], float], cells: tuple[int, int], exact: float, bar: float) -> Outcome:
    """Mid-edge bending on two meshes, hinges on the finer one."""
    coarse, fine, hinges = of(cells[0], "midedge"), of(cells[1], "midedge"), of(cells[1], "hinge")
    order = float(np.log2(abs((coarse - exact) / (fine - exact))) / np.log2(cells[1] / cells[0]))
    return Outcome(fine, exact, bar, order=order, orders=ORDERS, hinges=hinges)


def twisted(cells: int, diagonals: str, model: str) -> float:
    """Bending energy of a unit square plate with z = k x y, over the exact D (1 - nu) k^2."""
    world, k = make_world([cloth(*rectangle((1, 1), (cells, cells), diagonals), PLATE)]), 1e-3
    x = world.start()
    x[:, 2] = k * x[:, 0] * x[:, 1]
    return float(bending(world, model=model).value(x)) / ((1 - PLATE.poisson_ratio) * k**2)  # type: ignore[union-attr]


def _twisted() -> Outcome:
    """The rows of the plates bend in two directions; here is no gradient of the curvature, so no order."""
    found, hinges = (twisted(10, "alternating", model) for model in ("midedge", "hinge"))
    return Outcome(found, 1.0, 1e-3, hinges=hinges)


def _plate(sides: str, mode: int, exact: float) -> Outcome:
    return _refined(lambda cells, model: plate_modes(sides, cells, model)[mode], (15, 30), exact, 2e-2)


def _beam(mode: int) -> Outcome:
    return _refined(lambda cells, model: beam_modes(cells, model)[mode], (20, 40), BEAM_MODES[mode], 1e-2)


def _drum(mode: int) -> Outcome:
    exact, coarse, fine = DRUM_MODES[mode], drum_modes(10)[mode], drum_modes(20)[mode]
    order = float(np.log2(abs((coarse - exact) / (fine - exact))))
    return Outcome(fine, exact, 1e-2, order=order, orders=ORDERS)


def _euler(ends: str, exact: float) -> Outcome:
    """The slopes of linear triangles make the thrust (q h)^2/12 too small; hinged ends leave a third order besides."""
    return _refined(lambda cells, model: euler_load(cells, ends, model), EULER_CELLS[ends], exact, 1e-2)


def _buckled() -> Outcome:
    exact = elastica_height(0.8)
    return Outcome(buckled_height(16, "midedge"), exact, 1e-2, hinges=buckled_height(16, "hinge"))


def _torque() -> Outcome:
    return _refined(ribbon_torque, (10, 20), helicoid_torque(), 2e-2)


def _ribbon() -> Outcome:
    found, hinges = (buckling_stretch(16, model) for model in ("midedge", "hinge"))
    return Outcome(found, critical_stretch(THIN, TWIST)[0], 2e-2, hinges=hinges)


def _rows() -> tuple[Row, ...]:
    plates = {"left": ("clamped at one side", CANTILEVER), "free": ("free", FREE), "all": ("clamped", CLAMPED)}
    rows = [("square plate twisted to z = k x y, nu = 0.3: energy / (D (1 - nu) k^2)", _twisted)]
    for sides, (name, exact) in plates.items():
        for mode, value in enumerate(exact):
            what = f"square plate, {name}, nu = 0.3, 30 cells, mode {mode + 1}: omega a^2 sqrt(rho/D)"
            rows.append((what, partial(_plate, sides, mode, value)))
    for mode in range(len(BEAM_MODES)):
        rows.append((f"cantilever strip, 40 cells, mode {mode + 1}: omega L^2 sqrt(rho/B)", partial(_beam, mode)))
    for mode in range(len(DRUM_MODES)):
        rows.append((f"round drum, 20 rings, mode shape {mode + 1}: omega R sqrt(rho/T)", partial(_drum, mode)))
    for ends, load in (("hinged", np.pi**2), ("clamped", 4 * np.pi**2)):
        rows.append(
            (
                f"Euler load of a strip with {ends} ends, {EULER_CELLS[ends][1]} cells: P L^2/B",
                partial(_euler, ends, load),
            )
        )
    rows.append(("strip with hinged ends, compressed to 0.8 of its length, at rest: height / L", _buckled))
    rows.append(("twisted ribbon under tension (Green 1936): torque / (2 D b)", _torque))
    rows.append(("the same ribbon as it buckles (Green 1937): strain of its mean line", _ribbon))
    return tuple(Row(f"A9{letter}", what, run) for letter, (what, run) in zip(ascii_lowercase, rows, strict=False))


ROWS = _rows()
