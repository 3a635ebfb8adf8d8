"""A1, the membrane: stretch and shear of one triangle, the patch test, rigid motions, a strip under its own weight."""

from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import ClothsimError
from clothsim.keys.fabric import Fabric
from clothsim.mesh.topology import border_edges, border_vertices
from clothsim.mesh.world import make_world
from clothsim.physics.energies.neo_hookean_membrane import NeoHookeanMembrane
from tests.known_answers.row import Outcome, Row
from tests.known_answers.unit_meshes import cloth, grid, irregular_grid, random_rotation
from tests.known_answers.unit_solver import equilibrium, held, those_on
from tests.support.effect_builders import gravity

MU, LAM = 1.0, 1.5
FABRIC = Fabric(1.0, 1.0, 4 * MU * (LAM + MU) / (LAM + 2 * MU), LAM / (LAM + 2 * MU), 0.0)
WIDTH = 0.02


# --- closed forms ---------------------------------------------------------------------------------------------------


def principal_stress(l1: float, l2: float) -> float:
    """P1 = mu (l1 - 1/l1) + lam ln(l1 l2)/l1 [N/m]."""
    return float(MU * (l1 - 1 / l1) + LAM * np.log(l1 * l2) / l1)


def stress(F: Floats) -> Floats:
    """P = mu (F - F C^-1) + lam ln J F C^-1, (3, 2) [N/m]."""
    inverse = F @ np.linalg.inv(F.T @ F)
    return MU * (F - inverse) + LAM * 0.5 * np.log(np.linalg.det(F.T @ F)) * inverse


def psi(F: Floats) -> float:
    """mu/2 (I1 - 2 - 2 ln J) + lam/2 (ln J)^2 [J/m2]."""
    C = F.T @ F
    log_J = 0.5 * np.log(np.linalg.det(C))
    return float(MU / 2 * (np.trace(C) - 2 - 2 * log_J) + LAM / 2 * log_J**2)


def free_width(l1: float) -> float:
    """l2 where nothing pulls across."""
    from scipy.optimize import brentq

    return float(brentq(lambda l2: principal_stress(l2, l1), 0.2, 1.5, xtol=1e-15))


def stretches(tension: float) -> tuple[float, float]:
    """(l1, l2) of a strip that carries P1 = `tension` with free sides."""
    from scipy.optimize import brentq

    l1 = brentq(lambda l1: principal_stress(l1, free_width(l1)) - tension, 1 - 1e-9, 3, xtol=1e-15)
    return float(l1), free_width(l1)


def drop(weight: float) -> float:
    """delta / L of a strip under its own weight: the section at s from the top carries the weight below it."""
    from scipy.integrate import quad

    return float(quad(lambda s: stretches(weight * (1 - s))[0] - 1, 0, 1, epsabs=1e-11)[0])


# --- what the package makes of them ---------------------------------------------------------------------------------


def strained(F: Floats) -> tuple[float, Floats]:
    """psi [J/m2] and P (3, 2) [N/m] of a square sheet of 2 triangles under F, P from the forces on its vertices.

    The forces f_v of an affine state are P : grad of the shape functions: P = sum over vertices f_v X_v' / area.
    """
    positions, triangles = grid(1, 1)
    energy = NeoHookeanMembrane.of(make_world([cloth(positions, triangles, FABRIC)]))
    x = positions[:, :2] @ F.T
    return energy.value(x), energy.gradient(x).T @ positions[:, :2]


def simulated_drop(weight: float, cells: int) -> float:
    """The drop of a strip of length 1 whose top is held at the width that it has in the solution.

    ClothsimError where it leaves its plane, or its top does not carry its weight.
    """
    fabric = Fabric(weight, 1.0, FABRIC.youngs_modulus, FABRIC.poisson_ratio, 0.0)
    positions, triangles = grid(1, cells, WIDTH, 1.0)
    world = make_world([cloth(positions, triangles, fabric)])
    energies = those_on(membrane=NeoHookeanMembrane.of(world), gravity=gravity(world, acceleration=(0.0, -1.0, 0.0)))
    start = positions * [stretches(weight)[1], 1.0, 1.0]
    top = np.flatnonzero(positions[:, 1] == 1.0)
    x = equilibrium(world, energies, start, held(start, top), tolerance=1e-10)
    force = energies["membrane"].gradient(x)[top].sum(axis=0)
    carried = weight * WIDTH - world.masses[top].sum()
    if np.abs(x[:, 2]).max() or np.abs(force - [0, carried, 0]).max() > 1e-8 * carried:
        raise ClothsimError("The hanging strip is not in equilibrium with its weight.")
    return float(-x[positions[:, 1] == 0.0, 1].mean())


def sliver_sheet(seed: int) -> tuple[Floats, Ints]:
    """An irregular square with slivers of aspect 1e3 about one inner vertex; corners shuffled: random material axes."""
    rng = np.random.default_rng(seed)
    positions, triangles = irregular_grid(seed, nx=5, ny=4)
    inner = np.setdiff1d(np.arange(len(positions)), border_vertices(triangles))
    apex = inner[len(inner) // 2]
    corners = triangles[np.flatnonzero((triangles == apex).any(axis=1))[0]]
    others = corners[corners != apex]
    middle = positions[others].mean(axis=0)
    positions[apex] = middle + 1e-3 * (positions[apex] - middle)
    rolls = rng.integers(0, 3, len(triangles))
    return positions, np.array([np.roll(t, k) for t, k in zip(triangles, rolls, strict=True)])


@dataclass(frozen=True)
class Patch:
    """A patch test, relative to the sheet's own scales.

    distance: of the inner vertices from the affine map; energy: relative; force: of the border from P N; moved: how far
    the inner vertices were put from the affine map first.
    """

    distance: float
    energy: float
    force: float
    moved: float


def patch(F: Floats, seed: int) -> Patch:
    """The sheet turned at random, its border moved by F (3, 2), its inside put wrong: where it comes to rest."""
    positions, triangles = sliver_sheet(seed)
    turn = random_rotation(seed + 10)
    world = make_world([cloth(positions @ turn.T, triangles, FABRIC)])
    F = random_rotation(seed + 20) @ F
    affine = positions[:, :2] @ F.T + [1.0, -2.0, 0.5]
    border = border_vertices(triangles)
    start = affine.copy()
    inner = np.setdiff1d(np.arange(len(start)), border)
    start[inner] += 1e-3 * np.random.default_rng(seed).standard_normal((len(inner), 3))
    start[inner[0]] += [0.01, 0.02, -0.03]
    energy = NeoHookeanMembrane.of(world)
    x = equilibrium(world, {"membrane": energy}, start, held(affine, border))
    size = np.ptp(positions, axis=0).max()
    # the force on the border is P N: half of each border edge's to either end; edges run with their triangle
    edges, _ = border_edges(triangles)
    along = (positions[edges[:, 1]] - positions[edges[:, 0]])[:, :2]
    outward = np.column_stack([along[:, 1], -along[:, 0]])
    expected = np.zeros_like(affine)
    np.add.at(expected, edges.ravel(), np.repeat(0.5 * outward @ stress(F).T, 2, axis=0))
    return Patch(
        distance=float(np.abs(x - affine).max() / size),
        energy=float(abs(energy.value(x) / (world.rest_areas.sum() * psi(F)) - 1)),
        force=float(np.abs(energy.gradient(x) - expected).max() / np.abs(expected).max()),
        moved=float(np.abs(start - affine)[inner].max()),
    )


STATES = {
    "biaxial": np.array([[1.3, 0.2], [0.1, 1.2], [0, 0]]),
    "sheared": np.array([[1.1, 0.6], [0.0, 1.4], [0, 0]]),
    "stretched far": np.array([[2.5, 0.0], [0.3, 1.1], [0, 0]]),
}


def worst_rigid_force() -> float:
    """Largest force / (mu L) over rigid motions of an irregular sheet: at random, by half a turn, mirrored."""
    positions, triangles = irregular_grid(nx=5, ny=4)
    world = make_world([cloth(positions, triangles, FABRIC)])
    energy = NeoHookeanMembrane.of(world)
    turns = [random_rotation(k) for k in range(4)] + [np.diag(d) for d in ((-1.0, -1, 1), (1.0, -1, -1), (1.0, 1, -1))]
    return max(float(np.abs(energy.gradient(positions @ turn.T + [3.0, -1, 2])).max()) / MU for turn in turns)


# --- the rows -------------------------------------------------------------------------------------------------------


def _flat(l1: float, l2: float, shear: float = 0.0) -> Floats:
    return np.array([[l1, shear], [0.0, l2], [0.0, 0.0]])


def _uniaxial(l1: float, printed: str, of_energy: bool = False) -> Outcome:
    l2 = free_width(l1)
    energy, P = strained(_flat(l1, l2))
    if of_energy:
        return Outcome(energy, psi(_flat(l1, l2)), 1e-12, printed=printed)
    return Outcome(float(P[0, 0]), principal_stress(l1, l2), 1e-12, printed=printed)


def _equibiaxial() -> Outcome:
    return Outcome(float(strained(_flat(1.5, 1.5))[1][1, 1]), principal_stress(1.5, 1.5), 1e-12, printed="1.64426355")


def _shear() -> Outcome:
    return Outcome(strained(_flat(1, 1, 0.4))[0], MU * 0.4**2 / 2, 1e-12)


def _patches() -> list[Patch]:
    return [patch(F, seed) for F in STATES.values() for seed in (0, 1)]


def _strip(weight: float, printed: str) -> Outcome:
    exact = drop(weight)
    coarse, fine = (simulated_drop(weight, cells) for cells in (16, 32))
    order = float(np.log2(abs((coarse - exact) / (fine - exact))))
    return Outcome(fine, exact, 1e-3, printed=printed, order=order, orders=(1.8, 3.0))


ROWS = (
    Row("A1a", "stress of a strip at a stretch of 1.1, sides free [N/m]", lambda: _uniaxial(1.1, "0.26385123")),
    Row("A1b", "stress of a strip at a stretch of 1.5, sides free [N/m]", lambda: _uniaxial(1.5, "1.04633399")),
    Row("A1c", "energy of the same strip [J/m2]", lambda: _uniaxial(1.5, "0.28627581", of_energy=True)),
    Row("A1d", "stress at an equibiaxial stretch of 1.5 [N/m]", _equibiaxial),
    Row("A1e", "energy of a simple shear of 0.4 [J/m2]", _shear),
    Row(
        "A1f",
        "patch test with slivers: largest distance from the affine map",
        lambda: Outcome(max(one.distance for one in _patches()), 0.0, 1e-10, unit="of the size"),
    ),
    Row(
        "A1g",
        "patch test: difference of border forces from P N",
        lambda: Outcome(max(one.force for one in _patches()), 0.0, 1e-10, unit="relative"),
    ),
    Row(
        "A1h",
        "rigid motions, half turns and reflections: largest force",
        lambda: Outcome(worst_rigid_force(), 0.0, 1e-12, unit="mu L"),
    ),
    Row("A1i", "strip under its own weight, w = 0.5: drop / length", lambda: _strip(0.5, "0.09683185")),
    Row("A1j", "strip under its own weight, w = 1: drop / length", lambda: _strip(1.0, "0.21438245")),
)
