"""Chain rule for dependent rows: against the dense product J' H J of the whole Jacobian, and finite differences."""

from dataclasses import dataclass

import numpy as np
import pytest

from clothsim.physics.energies.hessians import ElementHessian, LowRankHessian
from clothsim.solve.linear.dependent_rows import NO_DEPENDENT_ROWS, Dependence, DependentRows
from clothsim.solve.linear.linear_system import System
from clothsim.solve.linear.sparsity import make_pattern

RNG = np.random.default_rng(7)
CLOTH, UNKNOWNS, COUNT = 5, 5 + 4 + 2, 5 + 4 + 2 + 6 + 3 + 2
"""Rows: 5 of cloth, coordinates of bodies of 4 and of 2, 6 and 3 of their surfaces, 2 that are prescribed."""


@dataclass(frozen=True)
class Rows:
    parts: DependentRows
    jacobian: np.ndarray


@pytest.fixture
def rows():
    first = Dependence(slice(11, 17), slice(5, 9), RNG.standard_normal((6, 4)))
    second = Dependence(slice(17, 20), slice(9, 11), RNG.standard_normal((3, 2)))
    jacobian = np.zeros((COUNT, UNKNOWNS))
    jacobian[:UNKNOWNS] = np.eye(UNKNOWNS)
    for part in (first, second):
        jacobian[part.rows, part.unknowns] = part.weights
    return Rows(DependentRows((first, second), COUNT), jacobian)


ELEMENTS = {
    "cloth alone": [[0, 1, 2, 3]],
    "cloth and a body": [[0, 11, 12, 13], [1, 2, 14, 15], [1, 2, 3, 16]],
    "cloth and a body of two coordinates": [[0, 17, 18, 19]],
    "two bodies": [[11, 17, 18, 19], [12, 13, 17, 18]],
    "a body and a prescribed one": [[11, 20, 21, 20], [20, 12, 13, 14]],
    "all of them": [[0, 1, 2, 3], [0, 11, 12, 13], [12, 13, 17, 18], [11, 20, 21, 20], [4, 3, 17, 19]],
}


def symmetric(count, size):
    blocks = RNG.standard_normal((count, size, size))
    return blocks + blocks.transpose(0, 2, 1)


def low_rank(elements):
    factors = RNG.standard_normal((2 * len(elements), 12))
    return LowRankHessian(elements, 2 * np.arange(len(elements)), np.full(len(elements), 2), factors)


@pytest.mark.parametrize("name", ELEMENTS)
@pytest.mark.parametrize("make", [lambda e: ElementHessian(e, symmetric(len(e), 12)), low_rank])
def test_the_matrix_is_that_of_the_chain_rule(rows, name, make):
    elements = np.array(ELEMENTS[name])
    if name in ("all of them", "a body and a prescribed one"):
        elements[elements == 20] = 21 if make is low_rank else 20
    if make is low_rank and any(len(set(row)) < 4 for row in elements.tolist()):
        elements = np.array([row for row in elements.tolist() if len(set(row)) == 4] or [[0, 11, 12, 20]])
    hessian = make(elements)
    system = System(make_pattern(UNKNOWNS, np.zeros((0, 3), np.int64), []), "superlu", dependent=rows.parts)
    system.begin([elements])
    data = system.assemble([hessian])
    whole = np.kron(rows.jacobian, np.eye(3))
    expected = whole.T @ hessian.to_sparse(COUNT).toarray() @ whole
    upper = system.pattern.upper(data).toarray()
    ours = upper + upper.T - np.diag(np.diag(upper))
    assert ours == pytest.approx(expected, abs=1e-12 * np.abs(expected).max())


def test_displacements_and_gradients_go_through_the_jacobian(rows):
    dx = np.zeros((COUNT, 3))
    dx[:UNKNOWNS] = RNG.standard_normal((UNKNOWNS, 3))
    given = dx.copy()
    followed = rows.parts.follow(dx)
    expected = rows.jacobian @ given[:UNKNOWNS]
    assert followed[: UNKNOWNS + 9] == pytest.approx(expected[: UNKNOWNS + 9])
    assert not followed[20:].any()
    gradient = RNG.standard_normal((COUNT, 3))
    reduced = rows.parts.reduced(gradient)
    assert reduced[:UNKNOWNS] == pytest.approx(rows.jacobian.T @ gradient)
    assert (gradient * followed).sum() == pytest.approx(
        (reduced[:UNKNOWNS] * given[:UNKNOWNS]).sum() + (gradient[20:] * followed[20:]).sum()
    )


def test_without_dependent_rows_the_same_objects_come_back():
    gradient = np.ones((3, 3))
    hessian = ElementHessian(np.array([[0, 1]]), np.zeros((1, 6, 6)))
    assert not NO_DEPENDENT_ROWS
    assert NO_DEPENDENT_ROWS.reduced(gradient) is gradient
    assert NO_DEPENDENT_ROWS.follow(gradient) is gradient
    assert NO_DEPENDENT_ROWS.hessians([hessian])[0] is hessian


def test_a_patch_knows_what_moves_dependent_rows(rows):
    assert rows.parts.any_of(np.array([0, 6]))
    assert not rows.parts.any_of(np.array([0, 4]))


def test_unknowns_that_move_others_are_those_of_its_parts(rows):
    found = [rows.parts.any_of(np.array([row])) for row in range(UNKNOWNS + 1)]
    assert found == [False] * CLOTH + [True] * (UNKNOWNS - CLOTH) + [False]
