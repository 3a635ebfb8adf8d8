"""Rows of arrays: contiguous ones as a slice, all others as indices."""

import numpy as np
import pytest

from clothsim.base.vectors import as_rows, equal, taken


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
