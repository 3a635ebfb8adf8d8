"""Points on the listed path of the candidates: the fraction of the closest one, and the positions there."""

import numpy as np
import pytest

from clothsim.physics.contact.filter import (
    active_among,
    displacement_norms,
    pairs_possibly_within,
    path_end,
    path_fraction,
    point_on_path,
)

START, END = np.zeros((3, 3)), np.array([[3.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 4.0, 0.0]])
ROWS = np.arange(3)


@pytest.mark.parametrize(
    ("along", "fraction"), [(-0.5, 0.0), (0.0, 0.0), (0.3, 0.3), (0.99, 0.99), (1.0, 1.0), (2.0, 1.0)]
)
def test_the_fraction_of_the_closest_point_stays_on_the_path(along, fraction):
    beside = np.array([[0.0, 0.7, 0.2], [0.1, 0.2, 0.3], [-0.4, 0.0, 0.5]])  # perpendicular to the path
    assert path_fraction(along * END + beside, START, END, ROWS) == pytest.approx(fraction, abs=1e-14)


def test_rows_weigh_by_the_squares_of_their_paths():
    """The first row has arrived, the third has not begun: 9 / (9 + 16)."""
    x = END * [[1.0], [1.0], [0.0]]
    assert path_fraction(x, START, END, ROWS) == pytest.approx(9 / 25)
    assert path_fraction(x, START, END, ROWS[2:]) == 0.0
    assert path_fraction(x, END, END, ROWS) == 0.0


def test_a_point_on_the_path_and_the_rows_that_moved():
    positions, moved = point_on_path(START + 1.0, END + 1.0, 0.25)
    assert positions == pytest.approx(1.0 + 0.25 * END)
    assert moved.tolist() == [True, False, True]
    assert not point_on_path(START, END, 0.0)[1].any()


def test_displacements_are_the_larger_of_both_ends_and_the_largest_of_each_group():
    reference, before = np.zeros((5, 3)), np.zeros((5, 3))
    before[1, 0], before[3, 1], before[4, 2] = 3.0, 9.0, 2.0
    after = before.copy()
    after[1, 1] = 4.0
    rows = np.array([0, 1, 4, 2])
    found, first, second = displacement_norms(before, after, reference, rows, 2)
    assert found.tolist() == [0.0, 5.0, 0.0, 0.0, 2.0]
    assert (first, second) == (5.0, 2.0)
    after[2, 2] = np.nan
    found, first, second = displacement_norms(before, after, reference, rows, 2)
    assert (found[2], first, second) == (np.inf, 5.0, np.inf)
    assert displacement_norms(before, after, reference, rows, 4)[1:] == (np.inf, 0.0)


def test_the_end_of_a_path_is_finite_where_all_of_it_is():
    x, dx = np.random.default_rng(3).standard_normal((2, 4, 3))
    end, finite = path_end(x, dx, 0.3)
    assert finite
    assert np.array_equal(end, x + 0.3 * dx)
    for number in (np.nan, np.inf, -np.inf):
        dx[3, 2] = number
        assert not path_end(x, dx, 0.3)[1]


@pytest.mark.parametrize("limit", [0.1, 0.5, 1.0])
@pytest.mark.parametrize("still", [False, True])
def test_the_largest_approach_only_spares_work(limit, still):
    """Without it, given as infinite, each pair is looked at: the same pairs are found."""
    rng = np.random.default_rng(5)
    reference = rng.uniform(size=(40, 3))
    first, second = (rng.permuted(np.tile(np.arange(20), (300, 1)), axis=1)[:, :3] for _ in range(2))
    second += 20
    elements = np.column_stack([first[:, 0], second])
    elements[150:] = np.column_stack([first[150:, :2], second[150:, :2]])
    x = reference + 0.02 * rng.normal(size=(40, 3))
    x[20:] = reference[20:] if still else x[20:]
    displacement, *largest = displacement_norms(x, x, reference, np.arange(40), 20)
    assert (largest[1] == 0.0) == still
    pairs = elements, 150, rng.uniform(0.0, 1.5, 300)
    for kernel, before, after in ((active_among, (x,), (limit,)), (pairs_possibly_within, (), (limit, 1.2))):
        found, every = (kernel(*before, *pairs, displacement, most, *after) for most in (sum(largest), np.inf))
        assert 0 < len(every) < 300
        assert np.array_equal(found, every)
