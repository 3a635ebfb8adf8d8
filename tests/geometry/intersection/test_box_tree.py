"""Box queries against brute force."""

import numpy as np
import pytest

from clothsim.base.jit import kernel
from clothsim.geometry.intersection import intersecting_pairs as box_tree

boxes, next_leaves, tree, within = map(  # compiled, as in use
    kernel, (box_tree.boxes, box_tree.next_leaves, box_tree.tree, box_tree.within)
)


def leaves_of(order, nodes):
    """Items of each leaf by its node."""
    first = len(nodes) // 2
    return {
        node: order[slice(*box_tree.leaf_range(len(order), nodes, node))].tolist() for node in range(first, 2 * first)
    }


def search(lower, upper, low=None, high=None):
    """Pairs of boxes that overlap, by the traversal of two trees, or of one with itself."""
    itself = low is None
    low, high = (lower, upper) if itself else (low, high)
    order, nodes = tree(lower, upper, box_tree.LEAF)
    other_order, other_nodes = (order, nodes) if itself else tree(low, high, box_tree.LEAF)
    assert np.array_equal(np.sort(order), np.arange(len(lower)))
    items, others = leaves_of(order, nodes), leaves_of(other_order, other_nodes)
    stack, waiting, found = np.ones((box_tree.STACK, 2), np.int64), 1, []
    while True:
        waiting, a, b = next_leaves(stack, waiting, nodes, other_nodes, itself)
        if a == 0:
            return found
        pairs = [(i, j) for i in items[a] for j in others[b] if not (itself and a == b and j <= i)]
        found += [(i, j) for i, j in pairs if box_tree.rows_overlap(lower, upper, i, low, high, j)]


def brute(lower, upper, low, high):
    meets = ((lower[:, None] <= high) & (low <= upper[:, None])).all(axis=2)
    return [tuple(pair) for pair in np.argwhere(meets).tolist()]


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
    expected = brute(lower, upper, lower, upper)
    found = search(lower, upper)
    assert sorted(tuple(sorted(pair)) for pair in found) == [(i, j) for i, j in expected if i < j]
    assert sorted(search(lower, upper, lower, upper)) == expected


def test_few_large_boxes_against_many_small_ones():
    small, large = soup("random", 400), (np.array([[-9.0, -9, -9], [2, 2, 2]]), np.array([[9.0, 9, 0.3], [3, 3, 3]]))
    assert sorted(search(*small, *large)) == brute(*small, *large)
    assert sorted(search(*large, *small)) == brute(*large, *small)


def test_boxes_near_others_are_those_that_overlap_their_common_box():
    lower, upper = soup("random", 50)
    low, high = np.array([[0.1, 0.1, 0.1], [0.6, 0.2, 0.3]]), np.array([[0.2, 0.2, 0.2], [0.7, 0.4, 0.4]])
    expected = ((lower <= high.max(axis=0)) & (low.min(axis=0) <= upper)).all(axis=1)
    assert 0 < expected.sum() < 50
    assert np.array_equal(within(lower, upper, low, high), np.flatnonzero(expected))
    assert len(within(lower, upper, low + 9, high + 9)) == 0


def test_boxes_are_of_the_corners():
    x = np.random.default_rng(0).random((9, 3))
    lower, upper = boxes(x, np.arange(9).reshape(3, 3))
    assert np.array_equal(lower, x.reshape(3, 3, 3).min(axis=1))
    assert np.array_equal(upper, x.reshape(3, 3, 3).max(axis=1))
