"""The hierarchy of boxes against the comparison of every box with every other."""

from dataclasses import replace

import numpy as np
import pytest

from clothsim.contact.broad_phase import that_may_meet
from clothsim.contact.bvh import build_tree, refit
from clothsim.contact.pair_order import in_order

FAR = 2000
"""More rows than boxes have here."""


def corners(lower, upper):
    """Boxes (m, 3) as elements of two rows each, and the rows."""
    m = len(lower)
    return np.column_stack([np.arange(m), m + np.arange(m)]), np.concatenate([lower, upper])


def tree_of(lower, upper):
    elements, rows = corners(lower, upper)
    return build_tree(elements, rows, rows)


def overlap_by_comparison(lower, upper, tree_lower, tree_upper):
    """Pairs (p, 2), sorted: closed overlap in all three axes."""
    meet = (lower[:, None] <= tree_upper[None]) & (tree_lower[None] <= upper[:, None])
    return np.argwhere(meet.all(axis=2))


def overlaps(queries, tree, grown=0.0, of=None, but=None):
    """Pairs (p, 2), sorted, of edges whose boxes overlap: all that do may meet, as far apart as they like."""
    if tree is not queries:  # other rows of x: else they share vertices
        tree = replace(tree, elements=tree.elements + FAR)
    x = np.zeros((2 * FAR, 3))
    labels, allowed = np.zeros(len(x), np.int64), np.ones((1, 1), bool)
    first, second, distances = that_may_meet(queries, tree, grown, labels, allowed, x, x, np.inf, of, but)
    assert (distances == 0.0).all()
    return np.column_stack([first, second])[in_order(first, second)]


def found_in(tree, lower, upper):
    """Pairs (p, 2) of queries and boxes of the tree, sorted."""
    return overlaps(tree_of(lower, upper), tree)


def found_within(tree):
    """Pairs (p, 2) of boxes of the tree, sorted."""
    return overlaps(tree, tree)


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
    found = found_in(tree, query_lower, query_upper)
    assert found.dtype == np.int64
    np.testing.assert_array_equal(found, overlap_by_comparison(query_lower, query_upper, lower, upper))
    every = overlap_by_comparison(lower, upper, lower, upper)
    np.testing.assert_array_equal(found_within(tree), every[every[:, 0] < every[:, 1]])


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


@pytest.mark.parametrize("place", [0.0, 1e6, -1e-12])
def test_identical_boxes_all_overlap(place):
    lower = np.full((300, 3), place)
    tree = tree_of(lower, lower)
    assert len(found_within(tree)) == 300 * 299 // 2
    assert_all_pairs(lower, lower, lower[:5], lower[:5], tree)


def test_boxes_that_touch_overlap_and_those_an_ulp_apart_do_not():
    lower = np.array([[0.0, 0, 0], [1.0, 0, 0], [np.nextafter(2.0, 3.0), 0, 0]])
    tree = tree_of(lower, np.array([[1.0, 1, 1], [2.0, 1, 1], [3.0, 1, 1]]))
    np.testing.assert_array_equal(found_within(tree), [[0, 1]])


@pytest.mark.parametrize("share", [0.01, 0.2, 1.0])
@pytest.mark.parametrize("size", [0.01, 3.0])
def test_a_tree_in_which_some_have_moved_finds_what_a_new_one_finds(share, size):
    rng = np.random.default_rng(2)
    lower, upper = random_boxes(300, 0.1, rng)
    elements, rows = corners(lower, upper)
    tree = build_tree(elements, rows, rows)
    for _ in range(5):
        moves = rng.random(300) < share
        moves[:2] = True
        way = size * rng.uniform(-1, 1, lower.shape) * moves[:, None]
        lower, upper = lower + way, upper + way
        rows = np.concatenate([lower, upper])
        refit(tree, rows, rows, np.tile(moves, 2))
        assert_all_pairs(lower, upper, *random_boxes(50, 0.1, rng), tree)


def test_a_box_holds_its_element_all_the_way():
    before, after = np.array([[0.0, 0, 0], [1, 5, -1]]), np.array([[3.0, -2, 0], [-1, 0, 7]])
    tree = build_tree(np.array([[0, 1]]), before, after)
    np.testing.assert_array_equal(tree.boxes[0, :, 0], [-1, -2, -1, 3, 5, 7])
    assert np.isnan(tree.boxes[0, :, 1:]).all()


def test_only_those_asked_for_are_found_and_each_pair_once():
    rng = np.random.default_rng(7)
    lower, upper = random_boxes(300, 0.1, rng)
    tree, asked, but = tree_of(lower, upper), rng.random(300) < 0.1, rng.random(300) < 0.3
    grown = 0.05
    every = overlap_by_comparison(lower - grown, upper + grown, lower, upper)
    one, other = every.T
    of = np.concatenate([asked, np.zeros(300, bool)])  # a box hangs on two rows: one of them is enough
    found = overlaps(tree_of(lower, upper), tree, grown, of, np.tile(but, 2))
    np.testing.assert_array_equal(found, every[asked[one] & ~but[other]])
    found = overlaps(tree, tree, grown, of)
    np.testing.assert_array_equal(found, every[(one < other) & (asked[one] | asked[other])])
    found = overlaps(tree, tree, grown)
    np.testing.assert_array_equal(found, every[one < other])


def test_empty_inputs_have_no_pairs():
    none = np.zeros((0, 3))
    empty, one = tree_of(none, none), tree_of(none[:0], none[:0])
    lower, upper = np.zeros((2, 3)), np.ones((2, 3))
    for pairs in (found_within(empty), found_in(empty, lower, upper), found_in(one, none, none)):
        assert pairs.shape == (0, 2)
    assert found_in(tree_of(lower, upper), none, none).shape == (0, 2)


def test_pairs_do_not_depend_on_the_shape_of_the_tree():
    rng = np.random.default_rng(3)
    elements, elsewhere = corners(*random_boxes(200, 0.2, rng))
    tree = build_tree(elements, elsewhere, elsewhere)
    lower, upper = random_boxes(200, 0.2, rng)
    rows = np.concatenate([lower, upper])
    refit(tree, rows, rows, np.ones(400, bool))
    np.testing.assert_array_equal(found_within(tree), found_within(tree_of(lower, upper)))
