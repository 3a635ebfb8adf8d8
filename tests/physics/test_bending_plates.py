"""Plates that bend to a cylinder, against the elastica (VALIDATION A3).

The vertices of a column are tied and the columns are a fixed distance apart: the unknowns are the slopes of the
cells, x = P(slopes). So the numbers judge bending and the clamp alone, not the membrane. nu = 0, so B = D.
"""

from dataclasses import dataclass, fields, replace
from functools import lru_cache

import numpy as np
import pytest
from meshes import UNIT, cloth, grid
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from clothsim.energies.bending import bending
from clothsim.energies.hinge_bending import hinge_bending
from clothsim.mesh.clamp import clamped
from clothsim.mesh.hinges import Hinges
from clothsim.mesh.world import make_world

SHEET = replace(UNIT, poisson_ratio=0.0)
WIDTH, ROWS = 0.2, 2
STIFFNESS = UNIT.bending_stiffness

every_plate = pytest.mark.parametrize("diagonals", ["right", "alternating"])
every_model = pytest.mark.parametrize("model", ["hinge", "quadratic", "midedge"])
every_clamp = pytest.mark.parametrize("clamp", ["edge", "band"])


# --- the plate ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Plate:
    """A plate of length 1 beyond its clamp at x = 0; `held` cells lie behind the clamp and do not turn."""

    world: object
    cells: int
    held: int

    @property
    def columns(self):
        """The column of every vertex that moves with the plate."""
        return np.arange(self.world.n_cloth) // (ROWS + 1)

    def place(self, slopes):
        """x of all vertices, and the steps (cos, 0, -sin) of each cell times its length."""
        x = self.world.start()
        steps = np.column_stack([np.cos(slopes), 0 * slopes, -np.sin(slopes)]) / self.cells
        corners = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)]) - [self.held / self.cells, 0, 0]
        x[: self.world.n_cloth, [0, 2]] = corners[self.columns][:, [0, 2]]
        return x, steps


def plate(cells, diagonals="right", clamp="edge", factor=2.0):
    """A clamped plate; `factor` 1 undoes the doubling of the clamp's hinges."""
    held = {"edge": 0, "band": 1}[clamp]
    positions, triangles = grid(cells + held, ROWS, 1 + held / cells, WIDTH)
    positions[:, 0] -= held / cells
    if diagonals == "alternating":
        triangles = flip_every_other_diagonal(triangles, cells + held)
    world = make_world([cloth(positions, triangles, SHEET)])
    free = len(world.hinges.vertices)
    held_world, _ = clamped(world, [np.flatnonzero(positions[:, 0] < 1e-9)])
    ordinary = held_world.hinges.stiffness == STIFFNESS
    assert ordinary.sum() == (free if clamp == "edge" else free - ROWS)
    stiffness = np.where(ordinary, STIFFNESS, factor * STIFFNESS)
    return Plate(replace(held_world, hinges=replace(held_world.hinges, stiffness=stiffness)), cells, held)


def flip_every_other_diagonal(triangles, cells):
    triangles, half = triangles.copy(), len(triangles) // 2
    for k in range(half):
        if (k // ROWS + k % ROWS) % 2:
            a, b, c, d = *triangles[k], triangles[half + k, 2]
            triangles[k], triangles[half + k] = (a, b, d), (b, c, d)
    return triangles


def equilibrium(plate, model, forces=None, moment=0.0):
    """The slopes that minimise bending - forces.x - moment * last slope, by Newton with the exact second derivatives.

    forces: (n_cloth, 3). dx/ds_j = t_j in all columns beyond cell j, so the Hessian is J'HJ + diag(sum g.dt_j/ds_j),
    and dt_j/ds_j is the step of cell j reversed.
    """
    energy = bending(plate.world, model=model)
    slopes = np.zeros(plate.cells + plate.held)
    load = np.zeros((plate.world.n_vertices, 3))
    load[: plate.world.n_cloth] = 0.0 if forces is None else forces
    beyond = np.zeros((plate.world.n_vertices, len(slopes)))
    beyond[: plate.world.n_cloth] = plate.columns[:, None] > np.arange(len(slopes))
    for _ in range(40):
        x, steps = plate.place(slopes)
        turned = np.column_stack([steps[:, 2], 0 * slopes, -steps[:, 0]])
        force = energy.gradient(x) - load
        jacobian = (beyond[:, None, :] * turned.T).reshape(-1, len(slopes))
        gradient = jacobian.T @ force.ravel()
        gradient[-1] -= moment
        hessian = jacobian.T @ energy.hessian(x, project=False).to_sparse(len(x)) @ jacobian
        hessian -= np.diag(np.einsum("vi,vj,ji->j", force, beyond, steps))
        free = slice(plate.held, None)
        assert np.linalg.eigvalsh(hessian[free, free])[0] > 0
        change = np.linalg.solve(hessian[free, free], gradient[free])
        slopes[free] -= change
        if np.abs(change).max() < 1e-11:
            return slopes
    raise AssertionError("Newton did not converge in 40 iterations")


def tip(plate, slopes):
    """Reach and drop of the far edge, measured from the clamp."""
    x, _ = plate.place(slopes)
    return x[plate.world.n_cloth - 1, 0], -x[plate.world.n_cloth - 1, 2]


def weight(plate, gamma):
    """Gravity forces with rho_A g L^3/B = gamma, on the lumped masses."""
    g = gamma * STIFFNESS / UNIT.density
    return plate.world.masses[:, None] * [0.0, 0.0, -g]


def order(errors):
    return np.log2(errors[-2] / errors[-1])


# --- references -----------------------------------------------------------------------------------------------------


def cantilever(load):
    """Reach and drop of the tip: theta'' = -load(r) cos theta over the distance r from the tip, theta the slope down.

    theta'(0) = 0 at the tip, theta(1) = 0 at the clamp: shooting for the slope at the tip.
    """

    def shoot(slope):
        return solve_ivp(
            lambda r, y: [y[1], -load(r) * np.cos(y[0]), np.cos(y[0]), np.sin(y[0])],
            (0, 1),
            [slope, 0, 0, 0],
            method="DOP853",
            rtol=1e-12,
            atol=1e-12,
        ).y[:, -1]

    return shoot(brentq(lambda slope: shoot(slope)[0], 0, np.pi / 2, xtol=1e-14))[2:]


@lru_cache
def hanging_cantilever(gamma):
    """The tip under gravity: the section at r from the tip carries the weight beyond it, gamma r."""
    return tuple(cantilever(lambda r: gamma * r))


@lru_cache
def pushed_cantilever(load):
    """The tip under an end shear P L^2/B = load."""
    return tuple(cantilever(lambda r: load))


@pytest.mark.parametrize(("gamma", "ratio"), [(1, 0.12456177), (10, 1.06680232), (100, 5.88810462)])
def test_reference_of_the_hanging_cantilever(gamma, ratio):
    reach, drop = hanging_cantilever(gamma)
    assert drop / reach == pytest.approx(ratio, abs=1e-8)


def test_references_at_the_tip():
    assert hanging_cantilever(1) == pytest.approx((0.99124640, 0.12347140), abs=1e-8)
    reach, drop = pushed_cantilever(4)
    assert (drop, 1 - reach) == pytest.approx((0.66996418, 0.32894124), abs=1e-8)


# --- the tests ------------------------------------------------------------------------------------------------------


@every_plate
@every_model
@every_clamp
@pytest.mark.parametrize("gamma", [1, 10])
def test_hanging_cantilever_is_second_order(diagonals, model, clamp, gamma):
    reach, drop = hanging_cantilever(gamma)
    errors = []
    for cells in (10, 20, 40):
        p = plate(cells, diagonals, clamp)
        x, z = tip(p, equilibrium(p, model, weight(p, gamma)))
        errors.append(abs(z / x / (drop / reach) - 1))
    assert order(errors) >= 1.9
    assert errors[-1] <= 5e-3


@every_clamp
def test_without_doubling_the_clamp_is_first_order(clamp):
    reach, drop = hanging_cantilever(10)
    errors = []
    for cells in (10, 20, 40):
        p = plate(cells, clamp=clamp, factor=1.0)
        x, z = tip(p, equilibrium(p, "hinge", weight(p, 10)))
        errors.append(z / x / (drop / reach) - 1)
    assert errors[0] == pytest.approx(0.21, abs=0.01)
    assert errors[1] == pytest.approx(0.10, abs=0.01)
    assert 0.9 < order(errors) < 1.2


@every_plate
@every_model
def test_end_shear_is_second_order(diagonals, model):
    exact = np.array(pushed_cantilever(4))
    errors = []
    for cells in (10, 20, 40):
        p = plate(cells, diagonals)
        forces = np.zeros((p.world.n_cloth, 3))
        forces[-ROWS - 1 :, 2] = -4 * STIFFNESS * WIDTH / (ROWS + 1)
        errors.append(np.abs(tip(p, equilibrium(p, model, forces)) - exact).max())
    assert order(errors) >= 1.9
    assert errors[-1] <= 5e-3


@every_plate
@every_model
@pytest.mark.parametrize("turns", [0.25, 0.5, 1.0])
def test_roll_up_by_an_end_moment(diagonals, model, turns):
    angle = 2 * np.pi * turns
    exact = np.array([np.sin(angle), 1 - np.cos(angle)]) / angle
    errors = []
    for cells in (20, 40):
        p = plate(cells, diagonals)
        slopes = equilibrium(p, model, moment=angle * STIFFNESS * WIDTH)
        errors.append(np.abs(tip(p, slopes) - exact).max())
    assert errors[-1] <= 5e-3
    # The polygon of equal angles closes exactly: no error is left to have an order.
    exact_there = turns == 1.0 and model != "quadratic"
    assert errors[-1] < 1e-12 if exact_there else order(errors) >= 1.9


# --- what belongs to the mesh, not to the material ------------------------------------------------------------------

LATTICES = {"right": np.eye(2), "equilateral": np.array([[1, -0.5], [0, np.sqrt(3) / 2]])}


def stiffness_ratio(lattice, curvatures):
    """2 E / (D area) of a plate bent to w = x'Cx/2, over whole cells inside the plate: C = `curvatures (2, 2)`."""
    cells, size = 8, 1e-4
    parameters, triangles = grid(cells, cells)
    flat = np.zeros_like(parameters)
    flat[:, :2] = parameters[:, :2] @ LATTICES[lattice].T
    hinges = make_world([cloth(flat, triangles)]).hinges
    middle = parameters[hinges.vertices[:, :2]].mean(axis=1)[:, :2] - 0.5 / cells * 0.1
    inside = ((middle > 0.25) & (middle < 0.75)).all(axis=1)
    assert inside.sum() == 3 * (cells // 2) ** 2
    kept = Hinges(*(getattr(hinges, field.name)[inside] for field in fields(hinges)))
    bent = flat.copy()
    bent[:, 2] = size * np.einsum("vi,ij,vj->v", flat[:, :2], curvatures, flat[:, :2]) / 2
    area = 0.25 * np.linalg.det(LATTICES[lattice])
    return 2 * hinge_bending(kept).value(bent) / (STIFFNESS * area * size**2)


def cylinder(degrees):
    across = np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))])
    return np.outer(across, across)


@pytest.mark.parametrize(
    ("lattice", "degrees", "ratio"),
    [("equilateral", d, 1.0) for d in (0, 20, 45, 90)]
    + [("right", 0, 1.0), ("right", 90, 1.0), ("right", 45, 3.0), ("right", 135, 1.0)],
)
def test_a_cylinder_costs_what_the_mesh_makes_of_it(lattice, degrees, ratio):
    assert stiffness_ratio(lattice, cylinder(degrees)) == pytest.approx(ratio, rel=1e-6)


@pytest.mark.parametrize(("lattice", "poisson_ratio"), [("right", 0.0), ("equilateral", -1 / 3)])
def test_poisson_s_ratio_is_the_mesh_s(lattice, poisson_ratio):
    """w = (x^2 + y^2)/2 costs D/2 (1 + 1 + 2 nu) an area, but for the material's own nu = 0.25."""
    assert stiffness_ratio(lattice, np.eye(2)) == pytest.approx(2 + 2 * poisson_ratio, rel=1e-6)
