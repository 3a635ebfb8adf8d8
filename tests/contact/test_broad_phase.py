"""The hierarchy of boxes against the comparison of every box with every other."""

import numpy as np
import pytest

from clothsim.contact.broad_phase import build_tree, in_order, overlapping, overlapping_self, refit


def overlap_by_comparison(lower, upper, tree_lower, tree_upper):
    """Pairs (p, 2), sorted: closed overlap in all three axes."""
    meet = (lower[:, None] <= tree_upper[None]) & (tree_lower[None] <= upper[:, None])
    return np.argwhere(meet.all(axis=2))


def found_in(tree, lower, upper):
    """Pairs (p, 2) of queries and boxes of the tree, sorted."""
    return np.column_stack(in_order(overlapping(build_tree(lower, upper), tree)))


def found_within(tree):
    """Pairs (p, 2) of boxes of the tree, sorted."""
    return np.column_stack(in_order(overlapping_self(tree)))


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
    assert_all_pairs(lower, upper, *random_boxes(50, size, rng), build_tree(lower, upper))


def test_huge_and_tiny_boxes_mixed():
    rng = np.random.default_rng(1)
    lower, upper = mixed_boxes(400, rng)
    assert_all_pairs(lower, upper, *mixed_boxes(200, rng), build_tree(lower, upper))


@pytest.mark.parametrize("place", [0.0, 1e6, -1e-12])
def test_identical_boxes_all_overlap(place):
    lower = np.full((300, 3), place)
    tree = build_tree(lower, lower)
    assert len(found_within(tree)) == 300 * 299 // 2
    assert_all_pairs(lower, lower, lower[:5], lower[:5], tree)


def test_boxes_that_touch_overlap_and_those_an_ulp_apart_do_not():
    lower = np.array([[0.0, 0, 0], [1.0, 0, 0], [np.nextafter(2.0, 3.0), 0, 0]])
    tree = build_tree(lower, np.array([[1.0, 1, 1], [2.0, 1, 1], [3.0, 1, 1]]))
    np.testing.assert_array_equal(found_within(tree), [[0, 1]])


@pytest.mark.parametrize("moved", [0.01, 3.0])
def test_a_refitted_tree_finds_what_a_new_one_finds(moved):
    rng = np.random.default_rng(2)
    lower, upper = random_boxes(300, 0.1, rng)
    tree = build_tree(lower, upper)
    way = moved * rng.uniform(-1, 1, lower.shape)
    there = refit(tree, lower + way, upper + way)
    assert_all_pairs(lower + way, upper + way, lower, upper, there)
    assert_all_pairs(lower, upper, lower, upper, tree)  # the first tree is as it was


def test_empty_inputs_have_no_pairs():
    none = np.zeros((0, 3))
    empty, one = build_tree(none, none), build_tree(none[:0], none[:0])
    lower, upper = np.zeros((2, 3)), np.ones((2, 3))
    for pairs in (found_within(empty), found_in(empty, lower, upper), found_in(one, none, none)):
        assert pairs.shape == (0, 2)
    assert found_in(build_tree(lower, upper), none, none).shape == (0, 2)
    assert found_within(refit(empty, none, none)).shape == (0, 2)


def test_pairs_do_not_depend_on_the_shape_of_the_tree():
    rng = np.random.default_rng(3)
    lower, upper = random_boxes(200, 0.2, rng)
    elsewhere = build_tree(*random_boxes(200, 0.2, rng))
    np.testing.assert_array_equal(found_within(refit(elsewhere, lower, upper)), found_within(build_tree(lower, upper)))
