"""Displacements of a drape that its model does not explain, and numbers beside them."""

import numpy as np
import pytest
from scipy.sparse import csr_array

from clothsim.gradients.camera import Residuals
from clothsim.gradients.placed_drape import LENGTH, SPREAD, STRAIN, PlacedDrape, precision_of_displacements
from clothsim.mesh.generators.shapes import disk


@pytest.fixture(scope="module")
def plate():
    """Positions and triangles of a disc of 1 m, and the precision of its displacements."""
    flat, triangles = disk(0.5, 12)
    positions = np.column_stack([flat[:, :2], np.zeros(len(flat))])
    return positions, triangles, precision_of_displacements(positions, triangles)


def measured(positions, count, seed=0):
    """Residuals of `count` mixtures of the coordinates, and the derivatives of the vertices by two numbers."""
    rng = np.random.default_rng(seed)
    jacobian = csr_array(rng.normal(size=(count, positions.size)) * 30.0)
    moves = np.stack([positions, positions[:, [2, 0, 1]]], axis=2).reshape(-1, 2)
    found = Residuals(
        rng.normal(size=count), jacobian, rng.uniform(0.5, 2.0, count), np.zeros((count, 2)), huber=np.inf
    )
    return found, moves


def placed_of(found, precision):
    return PlacedDrape.of([found], precision)


def test_a_shift_a_turn_and_a_stretch_cost_what_their_integrals_do(plate):
    positions, _, precision = plate
    area, c = np.pi * 0.25, np.log(10.0) / (2.0 * np.pi * SPREAD**2)

    def cost(field):
        return field.ravel() @ (precision @ field.ravel())

    shift = np.tile([1.0, 0.0, 0.0], (len(positions), 1))
    assert cost(shift) == pytest.approx(c * area / LENGTH**2, rel=0.02)
    turn = np.cross([0.0, 0.0, 1.0], positions)
    moment = (positions**2).sum(axis=1).mean()  # about r^2/2 of the disc
    assert moment == pytest.approx(0.125, rel=0.1)
    assert cost(turn) == pytest.approx(c * area * (0.125 / LENGTH**2 + 2.0), rel=0.05)
    stretch = positions.copy()
    strained = area / (STRAIN * LENGTH) ** 2
    assert cost(stretch) == pytest.approx(strained + c * area * (0.125 / LENGTH**2 + 2.0), rel=0.05)


def test_what_is_left_beside_displacements_is_the_least_sum_over_both(plate):
    """Against the dense system of numbers and displacements."""
    positions, _, precision = plate
    found, moves = measured(positions, 40)
    placed = placed_of(found, precision)
    rows, w = found.jacobian.toarray(), np.diag(found.weights)
    a, b, g = rows.T @ w @ rows, precision.toarray(), rows.T @ w @ found.values
    u = np.linalg.solve(a + b, -g)
    np.testing.assert_allclose(placed.displacement, u, rtol=1e-7, atol=1e-12)
    left = found.values + rows @ u
    lower = 0.5 * found.values @ w @ found.values - 0.5 * left @ w @ left - 0.5 * u @ b @ u
    assert placed.gain == pytest.approx(lower, rel=1e-9)
    np.testing.assert_allclose(placed.slope_left, rows.T @ w @ left, rtol=1e-6, atol=1e-9)
    both = np.block([[moves.T @ a @ moves, moves.T @ a], [a @ moves, a + b]])
    step = np.linalg.solve(both, -np.concatenate([moves.T @ g, g]))[:2]
    beside = placed.beside(moves)
    np.testing.assert_allclose(np.linalg.solve(moves.T @ a @ beside, -beside.T @ g), step, rtol=1e-6)


def test_the_covariance_is_that_of_numbers_where_displacements_are_drawn(plate):
    positions, _, precision = plate
    found, moves = measured(positions, 40)
    placed = placed_of(found, precision)
    rows, w = found.jacobian.toarray(), np.diag(found.weights)
    inverse = np.linalg.inv(moves.T @ placed.curvature @ placed.beside(moves))
    step_of_u = inverse @ placed.beside(moves).T @ rows.T @ w @ rows
    expected = step_of_u @ np.linalg.solve(precision.toarray(), step_of_u.T)
    np.testing.assert_allclose(placed.covariance(placed.beside(moves), inverse), expected, rtol=1e-6)


@pytest.mark.parametrize("factor", [0.3, 1.0, 2.0])
def test_how_far_the_cloth_is_displaced_is_seen(plate, factor):
    """Displacements drawn with `factor` times the spread, and seen exactly."""
    positions, _, precision = plate
    root = np.linalg.cholesky(precision.toarray())
    u = factor * np.linalg.solve(root.T, np.random.default_rng(1).normal(size=positions.size))
    noise = 1e-7
    found = Residuals(
        -u / noise, csr_array(np.eye(len(u)) / noise), np.ones(len(u)), np.zeros((len(u), 2)), huber=np.inf
    )
    assert placed_of(found, precision).spread() == pytest.approx(factor, rel=4 / np.sqrt(2 * len(u)))
