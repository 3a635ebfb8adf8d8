"""Ray casting: hits far from the origin, of no triangles, and where on them."""

import numpy as np

from clothsim.base.ray_casting import first_hits


def test_hits_of_a_small_triangle_far_away():
    eye = np.array([100.0, -40.0, 7.0])
    corners = eye + 1e-2 * np.array([[[-1.0, -1, 3], [2, -1, 3], [-1, 2, 3]], [[-9, -9, 5], [9, -9, 5], [0, 9, 5]]])
    hits = first_hits(corners, eye, np.array([[0.0, 0, 1], [0, 0, -1], [-1.5, -1.5, 3]]))
    assert hits.triangle.tolist() == [0, -1, 1]
    np.testing.assert_allclose(hits.distance[[0, 2]], [0.03, 0.05 * np.sqrt(1.5)], rtol=1e-5)
    assert np.isinf(hits.distance[1])
    np.testing.assert_allclose(hits.weights[0], 1 / 3, atol=1e-5)


def test_nothing_to_hit():
    hits = first_hits(np.zeros((0, 3, 3)), np.zeros(3), np.ones((2, 3)))
    assert hits.triangle.tolist() == [-1, -1]
    assert len(first_hits(np.ones((1, 3, 3)), np.zeros(3), np.zeros((0, 3))).triangle) == 0
