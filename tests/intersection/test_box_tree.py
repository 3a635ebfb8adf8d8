"""Box queries against brute force."""

import numpy as np
import pytest

from clothsim.intersection import box_tree
from clothsim.jit import kernel

boxes, overlapping, tree = map(kernel, (box_tree.boxes, box_tree.overlapping, box_tree.tree))  # compiled, as in use


def search(lower, upper, low, high):
    order, nodes = tree(lower, upper)
    assert np.array_equal(np.sort(order), np.arange(len(lower)))
    hits = np.empty(len(lower), np.int64)
    return [sorted(hits[: overlapping(order, nodes, lower, upper, a, b, hits)]) for a, b in zip(low, high, strict=True)]


def brute(lower, upper, low, high):
    return [np.flatnonzero(((lower <= b) & (a <= upper)).all(axis=1)).tolist() for a, b in zip(low, high, strict=True)]


def soup(name, count, seed=0):
    rng = np.random.default_rng(seed)
    centre, size = rng.random((count, 3)), 0.1 * rng.random((count, 3))
    if name == "very different sizes":
        size *= 10.0 ** rng.uniform(-6, 2, (count, 1))
    if name == "all in one place":
        centre[:] = 0.5
    if name == "one far away":
        centre[0] = 1e9
    if name == "on a line, boxes that touch":
        centre, size = np.outer(rng.permutation(count), [1.0, 0, 0]), np.full((count, 3), 0.5)
    return centre - size, centre + size


@pytest.mark.parametrize("count", [1, 2, 3, 5, 17, 300])
@pytest.mark.parametrize(
    "name",
    ["random", "very different sizes", "all in one place", "one far away", "on a line, boxes that touch"],
)
def test_every_overlapping_box_is_found_once(name, count):
    lower, upper = soup(name, count)
    assert search(lower, upper, lower, upper) == brute(lower, upper, lower, upper)


def test_few_large_boxes_against_many_small_ones():
    small, large = soup("random", 400), (np.array([[-9.0, -9, -9], [2, 2, 2]]), np.array([[9.0, 9, 0.3], [3, 3, 3]]))
    assert search(*small, *large) == brute(*small, *large)
    assert search(*large, *small) == brute(*large, *small)


def test_boxes_are_of_the_corners():
    x = np.random.default_rng(0).random((9, 3))
    lower, upper = boxes(x, np.arange(9).reshape(3, 3))
    assert np.array_equal(lower, x.reshape(3, 3, 3).min(axis=1))
    assert np.array_equal(upper, x.reshape(3, 3, 3).max(axis=1))
