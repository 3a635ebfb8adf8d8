"""The places of element lists that a system remembers follow its pattern."""

import numpy as np

from clothsim.energies.base import ElementHessian
from clothsim.energies.inertia import diagonal_hessian
from clothsim.solve.pattern import make_pattern
from clothsim.solve.system import System

TRIANGLES = np.array([[0, 1, 2], [3, 4, 5]])


def blocks(elements, seed):
    size = 3 * elements.shape[1]
    return ElementHessian(elements, np.random.default_rng(seed).standard_normal((len(elements), size, size)))


def test_a_pattern_that_grows_moves_the_places_of_what_was_known():
    known, new = blocks(TRIANGLES, 0), blocks(np.array([[0, 3]]), 1)
    system = System(make_pattern(6, TRIANGLES, [known]), "superlu")
    before = system.assemble([known], list)
    np.testing.assert_array_equal(before, system.base.assemble([known])[0])
    for _ in range(2):  # the second time all places are remembered
        grown = system.assemble([known, new], list)
        np.testing.assert_array_equal(grown, system.pattern.assemble([known, new])[0])
    assert len(grown) > len(before)


def test_the_vertices_one_by_one_are_the_same_elements_each_time():
    first, second = diagonal_hessian(np.ones(5)), diagonal_hessian(np.full(5, 2.0))
    assert first.elements is second.elements
    assert first.elements.tolist() == [[0], [1], [2], [3], [4]]
    assert len(diagonal_hessian(np.ones(3)).elements) == 3
