"""Points on the listed path of the candidates: the fraction of the closest one, and the positions there."""

import numpy as np
import pytest

from clothsim.physics.contact.filter import path_fraction, point_on_path

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
