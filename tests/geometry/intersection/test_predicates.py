"""Signs of determinants against rational arithmetic, where double precision alone is wrong."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as some
from meshes import random_rotation
from rational import determinant_sign

from clothsim.base.jit import kernel
from clothsim.geometry.intersection import predicates
from clothsim.geometry.intersection.predicates import scaled

# as the kernels run them: compiled
grow, two_product, two_sum = map(kernel, (predicates.grow, predicates.two_product, predicates.two_sum))
orient2d, orient3d = map(kernel, (predicates.orient2d, predicates.orient3d))

numbers = some.floats(-1e30, 1e30, allow_subnormal=False).filter(lambda a: a == 0 or abs(a) > 1e-30)


@settings(max_examples=200, deadline=None)
@given(numbers, numbers)
def test_sums_and_products_lose_nothing(a, b):
    assert sum(map(Fraction, two_sum(a, b))) == Fraction(a) + Fraction(b)
    assert sum(map(Fraction, two_product(a, b))) == Fraction(a) * Fraction(b)


@settings(max_examples=100, deadline=None)
@given(some.lists(numbers, min_size=1, max_size=12))
def test_an_expansion_is_the_exact_sum_and_its_last_part_has_its_sign(terms):
    e, n = np.empty(12), 0
    for term in terms:
        n = grow(e, n, term)
    total = sum(map(Fraction, terms))
    assert sum(map(Fraction, e[:n])) == total
    assert np.all(e[:n] != 0)
    assert (n == 0) == (total == 0)
    if n:
        assert np.sign(e[n - 1]) == np.sign(float(total))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("offset", [0.0, 1e6])
def test_orient3d_of_points_in_nearly_one_plane(seed, offset):
    """Rounded points of a turned plane: some signs are 0, most are decided by the last digits."""
    rng = np.random.default_rng(seed)
    flat = np.column_stack([rng.integers(-8, 9, (60, 2)) / 8, np.zeros(60)])
    x = np.ascontiguousarray(flat @ random_rotation(seed).T + offset)
    x[::7, 2] = np.nextafter(x[::7, 2], np.inf)
    found = {determinant_sign(*x[k : k + 4]) for k in range(57)}
    assert {-1, 1} <= found
    for k in range(57):
        rows = tuple(range(k, k + 4))
        assert orient3d(x, *rows) == orient3d(scaled(x), *rows) == determinant_sign(*x[k : k + 4])


def test_doubles_alone_are_wrong_here():
    """Otherwise the test above would prove nothing."""
    x = np.array([[0.5, 0.5, 0.1], [12.0, 12.0, 0.2], [24.0, 24.0, 0.3], [0.5 + 2**-53, 0.5, 0.0]])
    x = np.vstack([x, [[0.1, 0.1, 0.1], [0.2, 0.2, 0.2], [0.7, 0.7, 0.7], [0.3, 0.3, 0.1 + 0.2]]])
    wrong = 0
    for rows in np.random.default_rng(0).permuted(np.tile(np.arange(8), (500, 1)), axis=1)[:, :4]:
        sign = determinant_sign(*x[rows])
        assert orient3d(x, *rows) == sign
        wrong += np.sign(np.linalg.det(x[rows[:3]] - x[rows[3]])) != sign
    assert wrong > 20


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_orient2d_is_orient3d_beside_an_axis(axis):
    rng = np.random.default_rng(axis)
    along = np.outer(rng.integers(-50, 50, 40) / 16, rng.standard_normal(3)) + 1 / 3
    along[::3] = np.nextafter(along[::3], 1)
    tip = np.eye(3)[axis]
    signs = []
    for k in range(38):
        a, b, c = np.where(tip, 0, along[k : k + 3])
        signs.append(determinant_sign(a, b, c + tip, c))
        assert orient2d(along, k, k + 1, k + 2, axis) == signs[-1]
    assert {-1, 1} <= set(signs)


def test_scaling_is_exact_and_reaches_every_size():
    x = np.array([[1e-200, 3.0e-201, 0.0], [-1e-199, 0.1e-199, 1e-210]])
    for factor in (1.0, 2.0**600, 2.0**-300):
        y = scaled(x * factor)
        assert 2.0**199 <= np.abs(y).max() <= 2.0**200
        assert np.array_equal(y, scaled(x))
    assert np.array_equal(scaled(np.zeros((2, 3))), np.zeros((2, 3)))
    assert scaled(np.zeros((0, 3))).shape == (0, 3)
