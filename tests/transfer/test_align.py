"""Similarities found again from points and from boxes."""

import numpy as np

from transfer.align import Similarity, by_boxes, by_points, span_a_plane

RNG = np.random.default_rng(2)
POINTS = RNG.normal(size=(9, 3))
TRIANGLES = np.arange(9).reshape(3, 3)
TURN = np.linalg.qr(RNG.normal(size=(3, 3)))[0]
TURN *= np.sign(np.linalg.det(TURN))


def test_points_give_the_similarity_back_also_where_they_lie_in_a_plane():
    made = Similarity(2.3, TURN, np.array([1.0, 2.0, 3.0]))
    for points in (POINTS, POINTS * [1, 1, 0], POINTS[:3]):
        found = by_points(points, made.apply(points))
        np.testing.assert_allclose(found.apply(POINTS), made.apply(POINTS), atol=1e-12)


def test_a_mirrored_target_is_never_met_by_a_mirror():
    found = by_points(POINTS, POINTS * [-1, 1, 1])
    assert np.linalg.det(found.rotation) > 0


def test_boxes_are_laid_over_one_another():
    found = by_boxes((POINTS, TRIANGLES), (3 * POINTS + [0, 5, 0], TRIANGLES))
    np.testing.assert_allclose(found.apply(POINTS), 3 * POINTS + [0, 5, 0], atol=1e-12)


def test_points_on_a_line_fix_no_rotation():
    assert span_a_plane(POINTS[:3])
    assert not span_a_plane(POINTS[:2])
    assert not span_a_plane(np.outer(np.arange(4.0), [1, 2, 3]))
    assert not span_a_plane(np.ones((4, 3)))
