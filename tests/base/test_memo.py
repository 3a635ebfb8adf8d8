"""Memo of the last arguments: no repeated evaluation, no false hit."""

import numpy as np

from clothsim.base.memo import CAPACITY, MESHES, Memo, known_for_arrays


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


def test_what_is_found_of_a_mesh_is_known_by_its_numbers_types_and_shape():
    calls = []

    @known_for_arrays
    def total(positions, role="body"):
        calls.append(role)
        return float(positions.sum()), positions.dtype, role

    x = np.ones((2, 3))
    for given in (x, x.copy(), x.astype(np.int64), x.reshape(3, 2), 2.0 * x, x):
        assert total(given) == (float(given.sum()), given.dtype, "body")
    assert total(x, role="cloth") == total(x, "cloth") == (6.0, x.dtype, "cloth")
    x[0, 0] = 5.0  # the same array with other numbers
    assert total(x)[0] == 10.0
    assert calls == ["body", "body", "body", "body", "cloth", "cloth", "body"]


def test_the_mesh_that_was_asked_for_last_is_the_last_to_go():
    calls = []
    known = known_for_arrays(lambda x: calls.append(x[0]) or x[0])
    body = np.array([-1.0])
    for garment in range(2 * MESHES):
        assert known(body) == -1.0
        assert known(np.array([float(garment)])) == garment
    assert calls == [-1.0, *range(2 * MESHES)]
    known(np.array([0.0]))  # forgotten: MESHES others came after it
    assert calls[-1] == 0.0
