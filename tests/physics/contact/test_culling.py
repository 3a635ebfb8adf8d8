"""Culling by separating directions: no close pair is lost, neighbours in common motion are culled."""

import numpy as np
import pytest
from contacts import body_surface, self_surface, sheet_on_ball, two_sheets

from clothsim.physics.contact.barrier_kernels import pairs_within
from clothsim.physics.contact.bvh import build_tree
from clothsim.physics.contact.candidates import Candidates
from clothsim.physics.contact.search import candidate_pairs

POINT, EDGE, TRIANGLE = np.array([[0]]), np.array([[0, 1]]), np.array([[3, 4, 5]])
ALLOWED, LABELS = np.array([[True]]), np.zeros(6, np.int64)


def smallest_distance(before, after, elements, n_points, steps=400):
    path = (before + t * (after - before) for t in np.linspace(0, 1, steps))
    return min(np.sqrt(pairs_within(x, elements, n_points, np.inf)[1].min()) for x in path)


def is_candidate(before, after, a, b, distance, allowed=ALLOWED):
    """Number of candidate pairs; the boxes, inflated without bound, overlap."""
    trees = build_tree(a, before, after), build_tree(b, before, after)
    return len(candidate_pairs(*trees, np.inf, LABELS, allowed, before, after, distance)[0])


@pytest.mark.parametrize("kind", ["point-triangle", "edge-edge"])
@pytest.mark.parametrize("translation", [0.0, 1e4])
def test_no_close_pair_is_culled_and_most_others_are(kind, translation):
    """Random paths of random pairs, thin triangles and short edges among them, against sampled distances."""
    rng = np.random.default_rng(5)
    a, b = (POINT, TRIANGLE) if kind == "point-triangle" else (EDGE, np.array([[3, 4]]))
    elements = np.column_stack([a, b])
    culled = distant = 0
    for _ in range(400):
        before = rng.standard_normal((6, 3))
        before[:3] += 2.0 * rng.standard_normal(3)
        before[4] = before[3] + 10.0 ** rng.uniform(-3, 0) * (before[4] - before[3])
        after = before + rng.uniform(0, 1) * rng.standard_normal((6, 3))
        distance = 0.3
        closest = smallest_distance(before, after, elements, int(kind == "point-triangle"))
        candidate = is_candidate(before + translation, after + translation, a, b, distance)
        assert candidate or closest > distance
        culled += not candidate
        distant += closest > 2.0 * distance
    assert distant > 100
    assert culled > 0.9 * distant


def test_common_translation_adds_no_candidates():
    before = np.array([[0, 0, 1.0], [1, 0, 1.0], [0, 0, 0], [0, 0, 0], [1, 0, 0], [0, 1, 0]])
    after = before + np.array([3.0, -7.0, 100.0])
    for a, b in ((EDGE, np.array([[3, 4]])), (POINT, TRIANGLE)):
        assert not is_candidate(before, after, a, b, 0.9)
    assert is_candidate(before, before, EDGE, np.array([[3, 4]]), 1.0 + 1e-12)


def test_incident_and_excluded_pairs_are_culled():
    before = np.zeros((6, 3))
    assert is_candidate(before, before, POINT, TRIANGLE, 1.0)  # no separating direction
    assert not is_candidate(before, before, np.array([[4]]), TRIANGLE, 1.0)
    assert not is_candidate(before, before, EDGE, np.array([[1, 3]]), 1.0)
    assert not is_candidate(before, before, POINT, TRIANGLE, 1.0, np.array([[False]]))


@pytest.mark.parametrize("kind", ["body", "self"])
def test_neighbours_are_not_candidates(kind):
    """Two sheets, and a sheet above a ball, far apart for the activation distance: a long common displacement adds no
    pair.
    """
    surface, x = self_surface(two_sheets()) if kind == "self" else body_surface(sheet_on_ball(0.5))
    candidates = Candidates(surface, 1e-3, 1e-3)
    candidates.step_limit(x, np.tile([0.3, 0.1, 0.5], (len(x), 1)))
    assert len(candidates._pairs) == 0
    assert candidates.builds == 1
