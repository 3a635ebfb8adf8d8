"""What is left out was never near; neighbours that move together are left out."""

import numpy as np
import pytest
from contacts import body_surface, self_surface, sheet_on_ball, two_sheets

from clothsim.contact.barrier_kernels import near_pairs
from clothsim.contact.broad_phase import that_may_meet
from clothsim.contact.bvh import build_tree
from clothsim.contact.candidates import Candidates

POINT, EDGE, TRIANGLE = np.array([[0]]), np.array([[0, 1]]), np.array([[3, 4, 5]])
FREE, ONE = np.array([[True]]), np.zeros(6, np.int64)


def smallest_distance(before, after, elements, n_points, steps=400):
    ways = (before + t * (after - before) for t in np.linspace(0, 1, steps))
    return min(np.sqrt(near_pairs(x, elements, n_points, np.inf)[1].min()) for x in ways)


def kept(before, after, a, b, distance, allowed=FREE):
    """Whether the pair is kept; the boxes, grown without end, overlap."""
    trees = build_tree(a, before, after), build_tree(b, before, after)
    return len(that_may_meet(*trees, np.inf, ONE, allowed, before, after, distance)[0])


@pytest.mark.parametrize("kind", ["point-triangle", "edge-edge"])
@pytest.mark.parametrize("place", [0.0, 1e4])
def test_no_pair_that_comes_near_is_left_out_and_most_others_are(kind, place):
    """Random ways of random pairs, thin triangles and short edges among them, against distances along the way."""
    rng = np.random.default_rng(5)
    a, b = (POINT, TRIANGLE) if kind == "point-triangle" else (EDGE, np.array([[3, 4]]))
    elements = np.column_stack([a, b])
    left_out = apart = 0
    for _ in range(400):
        before = rng.standard_normal((6, 3))
        before[:3] += 2.0 * rng.standard_normal(3)
        before[4] = before[3] + 10.0 ** rng.uniform(-3, 0) * (before[4] - before[3])
        after = before + rng.uniform(0, 1) * rng.standard_normal((6, 3))
        distance = 0.3
        near = smallest_distance(before, after, elements, int(kind == "point-triangle"))
        keeps = kept(before + place, after + place, a, b, distance)
        assert keeps or near > distance
        left_out += not keeps
        apart += near > 2.0 * distance
    assert apart > 100
    assert left_out > 0.9 * apart


def test_a_common_way_brings_none_nearer():
    before = np.array([[0, 0, 1.0], [1, 0, 1.0], [0, 0, 0], [0, 0, 0], [1, 0, 0], [0, 1, 0]])
    after = before + np.array([3.0, -7.0, 100.0])
    for a, b in ((EDGE, np.array([[3, 4]])), (POINT, TRIANGLE)):
        assert not kept(before, after, a, b, 0.9)
    assert kept(before, before, EDGE, np.array([[3, 4]]), 1.0 + 1e-12)


def test_pairs_that_share_a_vertex_or_may_not_touch_are_left_out():
    before = np.zeros((6, 3))
    assert kept(before, before, POINT, TRIANGLE, 1.0)  # no direction tells them apart
    assert not kept(before, before, np.array([[4]]), TRIANGLE, 1.0)
    assert not kept(before, before, EDGE, np.array([[1, 3]]), 1.0)
    assert not kept(before, before, POINT, TRIANGLE, 1.0, np.array([[False]]))


@pytest.mark.parametrize("kind", ["body", "self"])
def test_neighbours_are_no_candidates(kind):
    """Two sheets, and a sheet over a ball, far apart for what is asked: a long common way adds no pair."""
    surface, x = self_surface(two_sheets()) if kind == "self" else body_surface(sheet_on_ball(0.5))
    candidates = Candidates(surface, 1e-3, 1e-3)
    candidates.step_limit(x, np.tile([0.3, 0.1, 0.5], (len(x), 1)))
    assert len(candidates._pairs) == 0
    assert candidates.builds == 1
