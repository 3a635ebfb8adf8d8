"""When a system analyses its pattern: once, unless much has come or the very matrix is asked for."""

import numpy as np
import pytest

from clothsim.energies.base import ElementHessian
from clothsim.mesh.generate import rectangle
from clothsim.solve.pattern import make_pattern
from clothsim.solve.system import MANY, System

COUNT, TRIANGLES = 441, rectangle(cells=(20, 20))[1]


def squares(elements):
    """Positive definite blocks."""
    size = 3 * elements.shape[1]
    return ElementHessian(elements, np.tile(2.0 * np.eye(size) + 1.0, (len(elements), 1, 1)))


def far(count):
    """Pairs of vertices that the mesh does not couple."""
    return squares(np.column_stack([np.arange(count), np.arange(count) + 200]))


def grown(count):
    """A system that was analysed for the mesh, and the data of a matrix with so many more blocks."""
    system = System(make_pattern(COUNT, TRIANGLES, []), "superlu")
    assert system.analyses == 0
    data = system.assemble([squares(TRIANGLES)])
    system.solver.solve(data, np.ones(3 * COUNT))
    assert system.analyses == 1
    return system, system.assemble([squares(TRIANGLES), far(count)])


def test_a_few_new_blocks_are_lacked_by_the_preconditioner_and_by_it_alone():
    system, data = grown(5)
    solver, own = system.preconditioner(data)
    assert system.analyses == 1
    assert len(own) == len(data) - 9 * 5
    b = np.random.default_rng(0).standard_normal(3 * COUNT)
    rough = solver.solve(own, b)
    exact = system.solver.solve(data, b)
    assert system.analyses == 2
    assert np.abs(system.pattern.times(data)(exact) - b).max() < 1e-10
    assert np.abs(rough - exact).max() > 1e-6
    assert 0.5 < (rough @ b) / (exact @ b) < 2.0
    assert system.preconditioner(data) == (system.solver, data)


def test_where_many_blocks_have_come_the_pattern_is_analysed_anew():
    system, data = grown(int(MANY * (COUNT + 3 * 20 * 20)) + 2)
    _, own = system.preconditioner(data)
    assert own is data
    assert system.analyses == 2


@pytest.mark.parametrize("count", [0, 5])
def test_a_step_begins_with_its_own_pattern(count):
    system, _ = grown(5)
    system.begin([far(count).elements])
    assert system.analyses == 1
    assert system.solver is system.solver
    assert system.analyses == (2 if count else 1)  # nothing is analysed twice in a row
    assert len(system.pattern.columns) == len(system.base.columns) + count
