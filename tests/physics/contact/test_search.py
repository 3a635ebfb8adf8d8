"""Bounding volume hierarchy against the comparison of every box with every other."""

from dataclasses import replace

import numpy as np
import pytest

from clothsim.physics.contact.bvh import build_tree, refit
from clothsim.physics.contact.search import candidate_pairs, lexicographic_order

ROW_OFFSET = 2000
"""More rows than any test has boxes."""


def corners(lower, upper):
    """Boxes (m, 3) as elements of two rows each, and the rows."""
    m = len(lower)
    return np.column_stack([np.arange(m), m + np.arange(m)]), np.concatenate([lower, upper])


def tree_of(lower, upper):
    elements, rows = corners(lower, upper)
    return build_tree(elements, rows, rows)


def overlap_by_comparison(lower, upper, tree_lower, tree_upper):
    """Pairs (p, 2), sorted: closed overlap in all three axes."""
    overlap = (lower[:, None] <= tree_upper[None]) & (tree_lower[None] <= upper[:, None])
    return np.argwhere(overlap.all(axis=2))


def found_pairs(queries, tree, inflation=0.0, only=None, without=None):
    """Pairs (p, 2), sorted, of edges whose boxes overlap, at any distance of the edges."""
    if tree is not queries:  # other rows of x: else the elements have common vertices
        tree = replace(tree, elements=tree.elements + ROW_OFFSET)
    x = np.zeros((2 * ROW_OFFSET, 3))
    labels, allowed = np.zeros(len(x), np.int64), np.ones((1, 1), bool)
    first, second, distances = candidate_pairs(queries, tree, inflation, labels, allowed, x, x, np.inf, only, without)
    assert (distances == 0.0).all()
    return np.column_stack([first, second])[lexicographic_order(first, second)]


def pairs_of_boxes(tree, lower, upper):
    """Pairs (p, 2) of queries and boxes of the tree, sorted."""
    return found_pairs(tree_of(lower, upper), tree)


def pairs_within_tree(tree):
    """Pairs (p, 2) of boxes of the tree, sorted."""
    return found_pairs(tree, tree)


def random_boxes(count, size, rng):
    centre, half = rng.uniform(-1, 1, (count, 3)), size * rng.uniform(0.0, 1.0, (count, 3))
    return centre - half, centre + half


def mixed_boxes(count, rng):
    """Sizes from 1e-9 to 10, many centres equal to the last digit, some boxes without volume."""
    centre = np.round(rng.uniform(-1, 1, (count, 3)), 1)
    half = 10.0 ** rng.uniform(-9, 1, (count, 1)) * rng.uniform(0, 1, (count, 3))
    half[::7] = 0.0
    return centre - half, centre + half


def assert_all_pairs(lower, upper, query_lower, query_upper, tree):
    found = pairs_of_boxes(tree, query_lower, query_upper)
    assert found.dtype == np.int64
    np.testing.assert_array_equal(found, overlap_by_comparison(query_lower, query_upper, lower, upper))
    all_pairs = overlap_by_comparison(lower, upper, lower, upper)
    np.testing.assert_array_equal(pairs_within_tree(tree), all_pairs[all_pairs[:, 0] < all_pairs[:, 1]])


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 8, 9, 17, 100, 513])
@pytest.mark.parametrize("size", [0.02, 0.3])
def test_pairs_are_those_found_by_comparison(count, size):
    rng = np.random.default_rng(count)
    lower, upper = random_boxes(count, size, rng)
    assert_all_pairs(lower, upper, *random_boxes(50, size, rng), tree_of(lower, upper))


def test_huge_and_tiny_boxes_mixed():
    rng = np.random.default_rng(1)
    lower, upper = mixed_boxes(400, rng)
    assert_all_pairs(lower, upper, *mixed_boxes(200, rng), tree_of(lower, upper))


@pytest.mark.parametrize("coordinate", [0.0, 1e6, -1e-12])
def test_identical_boxes_all_overlap(coordinate):
    lower = np.full((300, 3), coordinate)
    tree = tree_of(lower, lower)
    assert len(pairs_within_tree(tree)) == 300 * 299 // 2
    assert_all_pairs(lower, lower, lower[:5], lower[:5], tree)


def test_touching_boxes_overlap_and_boxes_an_ulp_apart_do_not():
    lower = np.array([[0.0, 0, 0], [1.0, 0, 0], [np.nextafter(2.0, 3.0), 0, 0]])
    tree = tree_of(lower, np.array([[1.0, 1, 1], [2.0, 1, 1], [3.0, 1, 1]]))
    np.testing.assert_array_equal(pairs_within_tree(tree), [[0, 1]])


@pytest.mark.parametrize("portion", [0.01, 0.2, 1.0])
@pytest.mark.parametrize("size", [0.01, 3.0])
def test_refitted_tree_equals_a_new_one(portion, size):
    rng = np.random.default_rng(2)
    lower, upper = random_boxes(300, 0.1, rng)
    elements, rows = corners(lower, upper)
    tree = build_tree(elements, rows, rows)
    for _ in range(5):
        moved = rng.random(300) < portion
        moved[:2] = True
        displacement = size * rng.uniform(-1, 1, lower.shape) * moved[:, None]
        lower, upper = lower + displacement, upper + displacement
        rows = np.concatenate([lower, upper])
        refit(tree, rows, rows, np.tile(moved, 2))
        assert_all_pairs(lower, upper, *random_boxes(50, 0.1, rng), tree)


def test_box_encloses_the_path_of_its_element():
    before, after = np.array([[0.0, 0, 0], [1, 5, -1]]), np.array([[3.0, -2, 0], [-1, 0, 7]])
    tree = build_tree(np.array([[0, 1]]), before, after)
    np.testing.assert_array_equal(tree.boxes[0, :, 0], [-1, -2, -1, 3, 5, 7])
    assert np.isnan(tree.boxes[0, :, 1:]).all()


def test_restricted_query_finds_each_pair_once():
    rng = np.random.default_rng(7)
    lower, upper = random_boxes(300, 0.1, rng)
    tree, queried, without = tree_of(lower, upper), rng.random(300) < 0.1, rng.random(300) < 0.3
    inflation = 0.05
    all_pairs = overlap_by_comparison(lower - inflation, upper + inflation, lower, upper)
    one, other = all_pairs.T
    only = np.concatenate([queried, np.zeros(300, bool)])  # a box hangs on two rows: one of them is enough
    found = found_pairs(tree_of(lower, upper), tree, inflation, only, np.tile(without, 2))
    np.testing.assert_array_equal(found, all_pairs[queried[one] & ~without[other]])
    found = found_pairs(tree, tree, inflation, only)
    np.testing.assert_array_equal(found, all_pairs[(one < other) & (queried[one] | queried[other])])
    found = found_pairs(tree, tree, inflation)
    np.testing.assert_array_equal(found, all_pairs[one < other])


def test_empty_inputs_have_no_pairs():
    none = np.zeros((0, 3))
    empty, one = tree_of(none, none), tree_of(none[:0], none[:0])
    lower, upper = np.zeros((2, 3)), np.ones((2, 3))
    for pairs in (pairs_within_tree(empty), pairs_of_boxes(empty, lower, upper), pairs_of_boxes(one, none, none)):
        assert pairs.shape == (0, 2)
    assert pairs_of_boxes(tree_of(lower, upper), none, none).shape == (0, 2)


def test_pairs_do_not_depend_on_the_shape_of_the_tree():
    rng = np.random.default_rng(3)
    elements, elsewhere = corners(*random_boxes(200, 0.2, rng))
    tree = build_tree(elements, elsewhere, elsewhere)
    lower, upper = random_boxes(200, 0.2, rng)
    rows = np.concatenate([lower, upper])
    refit(tree, rows, rows, np.ones(400, bool))
    np.testing.assert_array_equal(pairs_within_tree(tree), pairs_within_tree(tree_of(lower, upper)))
