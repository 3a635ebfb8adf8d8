"""Plates bent to a cylinder, against the elastica (docs/results/validation.md A3), and mesh dependence of hinges."""

from dataclasses import fields

import numpy as np
import pytest
from meshes import cloth, grid

from clothsim.mesh.cloth import Hinges
from clothsim.mesh.world import make_world
from clothsim.physics.energies.hinge_bending import hinge_bending
from tests.known_answers.elastica import hanging_cantilever, pushed_cantilever, rolled_up
from tests.known_answers.tied_plates import ROWS, STIFFNESS, WIDTH, bent, end_shear, plate, tip, weight

every_plate = pytest.mark.parametrize("diagonals", ["right", "alternating"])
every_model = pytest.mark.parametrize("model", ["hinge", "quadratic", "midedge"])
every_clamp = pytest.mark.parametrize("clamp", ["edge", "band"])


def order(errors):
    return np.log2(errors[-2] / errors[-1])


# --- references -----------------------------------------------------------------------------------------------------


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
        x, z = tip(p, bent(p, model, weight(p, gamma)))
        errors.append(abs(z / x / (drop / reach) - 1))
    assert order(errors) >= 1.9
    assert errors[-1] <= 5e-3


@every_clamp
def test_the_clamp_doubles_its_own_hinges_alone(clamp):
    p = plate(10, clamp=clamp)
    doubled = p.world.hinges.stiffness == 2 * STIFFNESS
    assert doubled.sum() == ROWS
    assert (p.world.hinges.stiffness[~doubled] == STIFFNESS).all()


@every_clamp
def test_without_doubling_the_clamp_is_first_order(clamp):
    reach, drop = hanging_cantilever(10)
    errors = []
    for cells in (10, 20, 40):
        p = plate(cells, clamp=clamp, factor=1.0)
        x, z = tip(p, bent(p, "hinge", weight(p, 10)))
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
        errors.append(np.abs(tip(p, bent(p, model, end_shear(p, 4))) - exact).max())
    assert order(errors) >= 1.9
    assert errors[-1] <= 5e-3


@every_plate
@every_model
@pytest.mark.parametrize("turns", [0.25, 0.5, 1.0])
def test_roll_up_by_an_end_moment(diagonals, model, turns):
    angle = 2 * np.pi * turns
    exact = np.array(rolled_up(turns))
    errors = []
    for cells in (20, 40):
        p = plate(cells, diagonals)
        slopes = bent(p, model, moment=angle * STIFFNESS * WIDTH)
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
