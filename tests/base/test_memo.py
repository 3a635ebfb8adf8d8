"""Memo of the last arguments: no repeated evaluation, no false hit."""

import numpy as np

from clothsim.base.memo import CAPACITY, Memo


def test_the_last_places_are_known_by_their_numbers():
    asked = []

    def find(x):
        asked.append(x[0, 0])
        return 10.0 * x[0, 0]

    lately, x = Memo(), np.zeros((1, 3))
    for k in (0.0, 1.0, 0.0, 1.0, 2.0, 1.0, 0.0):
        x[0, 0] = k  # the same array with other numbers is another place
        assert lately.at(x, find) == 10.0 * k
    assert CAPACITY == 2
    assert asked == [0.0, 1.0, 2.0, 0.0]


def test_the_first_place_of_a_solve_is_known_at_its_end():
    asked = []
    first, x = Memo(keeps_first=True), np.zeros((1, 3))
    for k in (0.0, 1.0, 2.0, 3.0, 0.0, 3.0, 2.0, 1.0):
        first.at(np.full_like(x, k), lambda x: asked.append(x[0, 0]))
    assert asked == [0.0, 1.0, 2.0, 3.0, 1.0]


def test_what_is_not_finite_is_asked_again():
    asked = []
    lately = Memo()
    for _ in range(2):
        lately.at(np.full((1, 3), np.nan), asked.append)
    assert len(asked) == 2


def test_a_result_is_remembered_as_a_copy_of_its_place():
    lately, x = Memo(), np.zeros((1, 3))
    assert lately.known(x) is None
    assert lately.remember(x, "zero") == "zero"
    x += 1.0
    assert lately.known(x) is None
    assert lately.known(np.zeros((1, 3))) == "zero"
