"""Rows of arrays: contiguous ones as a slice, all others as indices."""

import numpy as np
import pytest

from clothsim.base.vectors import add_to, as_rows, equal, lengths, taken


@pytest.mark.parametrize("rows", [[], [3], [0, 1, 2], [2, 3, 4, 5], [0, 2], [0, 1, 3], [1, 2, 3, 5, 6]])
def test_rows_are_the_same_as_a_slice_and_one_by_one(rows):
    x, rows = np.arange(21.0).reshape(7, 3), np.array(rows, np.int64)
    place, other = as_rows(rows), np.zeros((7, 3))
    assert isinstance(place, slice) == (len(rows) > 0 and bool((np.diff(rows) == 1).all()))
    assert np.array_equal(taken(x, place), x[rows])
    other[place] = taken(x, place)
    assert other.sum() == x[rows].sum()


def test_what_is_not_finite_equals_nothing():
    x = np.arange(6.0).reshape(2, 3)
    assert equal(x, x.copy())
    for k in range(6):
        other = x.copy()
        other.flat[k] = 7.0
        assert not equal(x, other)
    x[1, 2] = np.nan
    assert not equal(x, x)


@pytest.mark.parametrize(("few", "many"), [(0, 1), (3, 5)])
def test_arrays_of_different_length_are_not_the_same(few, many):
    x = np.arange(3.0 * many).reshape(many, 3)
    assert not equal(x, x[:few].copy())
    assert not equal(x[:few].copy(), x)


@pytest.mark.parametrize("count", [0, 1, 7, 300])
def test_lengths_have_the_bits_of_numpy_s_norm(count):
    vectors = np.random.default_rng(count).normal(size=(count, 3)) * 10.0 ** np.arange(-3, 6, 3)
    assert np.array_equal(lengths(vectors), np.linalg.norm(vectors, axis=1))


def test_a_part_is_added_and_its_largest_component_returned():
    total, part = np.ones((2, 3)), np.array([[0.5, -4.0, 1.0], [3.0, 0.0, 2.0]])
    assert add_to(total, part) == 4.0
    assert np.array_equal(total, 1.0 + part)
    assert add_to(np.zeros((0, 3)), np.zeros((0, 3))) == 0.0


@pytest.mark.parametrize(("row", "axis"), [(0, 0), (0, 1), (1, 2)])
def test_a_shorter_part_is_added_to_the_first_rows(row, axis):
    total, part = np.ones((4, 3)), np.zeros((2, 3))
    part[row, axis] = -2.0
    assert add_to(total, part) == 2.0
    assert np.array_equal(total, np.ones((4, 3)) + np.vstack([part, np.zeros((2, 3))]))
