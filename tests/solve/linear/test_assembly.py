"""Cached block offsets of element lists after the pattern was extended."""

import numpy as np

from clothsim.physics.energies.hessians import ElementHessian, every_vertex
from clothsim.physics.energies.inertia import InertiaEnergy
from clothsim.solve.linear.linear_system import Patch, System
from clothsim.solve.linear.sparsity import make_pattern

TRIANGLES = np.array([[0, 1, 2], [3, 4, 5]])


def blocks(elements, seed):
    size = 3 * elements.shape[1]
    return ElementHessian(elements, np.random.default_rng(seed).standard_normal((len(elements), size, size)))


def test_a_pattern_that_grows_moves_the_places_of_what_was_known():
    known, new = blocks(TRIANGLES, 0), blocks(np.array([[0, 3]]), 1)
    system = System(make_pattern(6, TRIANGLES, [known]), "superlu")
    before = system.assemble([known])
    np.testing.assert_array_equal(before, system.base.assemble([known])[0])
    for _ in range(2):  # the second time all places are remembered
        grown = system.assemble([known, new])
        np.testing.assert_array_equal(grown, system.pattern.assemble([known, new])[0])
    assert len(grown) > len(before)


def test_the_vertices_one_by_one_are_the_same_elements_each_time():
    energy = InertiaEnergy(every_vertex(5), np.arange(1.0, 6.0), np.zeros((5, 3)), 1.0)
    first, second = energy.hessian(np.zeros((5, 3))), energy.hessian(np.ones((5, 3)))
    assert first.elements is second.elements
    assert first.elements.tolist() == [[0], [1], [2], [3], [4]]


def test_a_region_renumbers_its_rows_and_drops_the_others():
    patch = Patch(np.array([1, 4, 5]), 6)
    assert patch.moving.tolist() == [False, True, False, False, True, True]
    known = blocks(TRIANGLES, 0)
    system = System(make_pattern(6, TRIANGLES, [known]), "superlu").subsystem(patch)
    whole = known.to_sparse(6).toarray()
    entries = (3 * patch.rows[:, None] + np.arange(3)).ravel()
    data = system.assemble([known])
    np.testing.assert_array_equal(system.pattern.upper(data).toarray(), np.triu(whole[np.ix_(entries, entries)]))
    np.testing.assert_array_equal(patch.hessian(known.to_sparse(6)).toarray(), whole[np.ix_(entries, entries)])
    assert patch.renumbered(TRIANGLES) is patch.renumbered(TRIANGLES)
