"""Rods along edges against closed forms: a ring, a fold, a bar, a sheet that a rod keeps straight; refused input.

Euler's load, elastica, heavy loops and columns are rows A14 of the known answers.
"""

import numpy as np
import pytest
from effect_builders import stiffeners
from meshes import cloth, grid

from clothsim.base.errors import InputError
from clothsim.mesh.world import make_world
from clothsim.physics.energies.base import Off
from clothsim.physics.energies.edge_curves import EdgeCurve
from clothsim.physics.energies.stiffeners import rods_along
from tests.known_answers.a14_rods import FOUND


def sheet(n=2):
    return make_world([cloth(*grid(n, n))])


def ring(n, radius=1.0):
    angles = 2 * np.pi * np.arange(n) / n
    x = radius * np.column_stack([np.cos(angles), np.sin(angles), np.zeros(n)])
    line = np.append(np.arange(n), 0)
    return x, EdgeCurve(line, np.linalg.norm(np.diff(x[line], axis=0), axis=1))


def test_a_closed_ring_has_the_energy_of_its_curvature():
    """pi EI/R, with an error of the second order, and no force but along the radius."""
    errors = []
    for n in (24, 48):
        x, curve = ring(n, 2.0)
        energy = rods_along([(curve, 1.0, 3.0)])
        errors.append(energy.value(x) / (np.pi * 3.0 / 2.0) - 1)
        radial = energy.gradient(x)
        assert np.abs(np.cross(radial, x)).max() < 1e-12
    assert 1.9 < np.log2(errors[0] / errors[1]) < 2.1
    assert errors[1] < 5e-3


def test_an_edge_is_a_bar_that_pushes_too():
    energy = rods_along([(EdgeCurve(np.arange(2), np.array([0.5])), 8.0, 1.0)])
    for length in (0.4, 0.6):
        x = np.array([[0.0, 0, 0], [length, 0, 0]])
        assert energy.value(x) == pytest.approx(0.5 * 8.0 * (length / 0.5 - 1) ** 2 * 0.5)
        np.testing.assert_allclose(energy.gradient(x)[1], [8.0 * (length / 0.5 - 1), 0, 0])


def test_a_fold_is_out_of_reach():
    energy = rods_along([(EdgeCurve(np.arange(3), np.ones(2)), 1.0, 1.0)])
    fold = np.array([[0.0, 0, 0], [1, 0, 0], [0, 0, 0]])
    assert energy.value(fold) == np.inf
    assert np.isfinite(energy.value(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1e-3, 0]])))
    assert energy.value(np.array([[0.0, 0, 0], [0, 0, 0], [1, 0, 0]])) == np.inf
    assert np.isfinite(energy.gradient(fold)).all()


def test_the_projected_hessian_is_definite_and_the_exact_one_symmetric():
    rng = np.random.default_rng(5)
    energy = rods_along([(EdgeCurve(np.arange(6), np.full(5, 0.3)), 2.0, 0.7)])
    for _ in range(5):
        x = np.cumsum(rng.standard_normal((6, 3)), axis=0)
        exact = energy.hessian(x, project=False).to_sparse(6).toarray()
        np.testing.assert_allclose(exact, exact.T, atol=1e-12)
        projected = energy.hessian(x).to_sparse(6).toarray()
        assert np.linalg.eigvalsh(projected).min() > -1e-10
        assert np.linalg.eigvalsh(projected - exact).min() > -1e-10


def test_restricted_to_what_moves_it_has_the_same_force_there():
    energy = stiffeners(
        sheet(4), stiffener=[{"select": "boundary", "bending_stiffness": 2.0, "stretch_stiffness": 3.0}]
    )
    x = sheet(4).start() + 0.05 * np.random.default_rng(3).standard_normal((25, 3))
    moving = np.arange(25) < 6
    part = energy.restricted_to(moving, x)
    assert 0 < len(part.bending.rows) < len(energy.bending.rows)
    np.testing.assert_allclose(part.gradient(x)[moving], energy.gradient(x)[moving], atol=1e-13)


@pytest.mark.parametrize("row", range(len(FOUND)), ids=[each[0] for each in FOUND])
def test_rods_on_few_edges_are_near_the_closed_forms(row):
    _, found, exact, _, _ = FOUND[row]
    assert found(12) == pytest.approx(exact(), rel=0.2 if row == 3 else 0.03)


def test_what_does_nothing_is_off_and_what_is_wrong_is_named():
    assert isinstance(stiffeners(sheet()), Off)
    assert isinstance(stiffeners(sheet(), stiffener=[{"select": "left", "bending_stiffness": 0}]), Off)
    with pytest.raises(InputError, match=r"stiffener\[0\].select"):
        stiffeners(sheet(), stiffener=[{"select": [0, 8], "bending_stiffness": 1.0}])
    with pytest.raises(InputError, match="bending_stiffness"):
        stiffeners(sheet(), stiffener=[{"select": "left", "bending_stiffness": -1.0}])
