"""Part of a body near a garment."""

import numpy as np
from fitting_cases import capsule_figure, tube_garment

from clothsim.garments.fit.moving_body import MARGIN, near_body

BODY = capsule_figure(segments=16)
TUBE = tube_garment(0.11, height=0.1).positions


def test_the_part_has_all_triangles_near_and_none_far_away():
    frames, triangles = near_body(TUBE, [BODY.positions], BODY.triangles)
    assert 0 < len(triangles) < len(BODY.triangles)
    assert np.unique(triangles).tolist() == list(range(len(frames[0])))
    corners = {tuple(map(tuple, face)) for face in frames[0][triangles].tolist()}
    distance = np.linalg.norm(BODY.positions[:, None] - TUBE[None], axis=2).min(axis=1)
    near = distance < MARGIN * np.ptp(BODY.positions, axis=0).max()
    expected = BODY.positions[BODY.triangles[near[BODY.triangles].any(axis=1)]]
    assert corners == {tuple(map(tuple, face)) for face in expected.tolist()}


def test_all_frames_have_the_same_part():
    lower = BODY.positions - [0.0, 0.0, 0.3]
    frames, triangles = near_body(TUBE, [BODY.positions, lower], BODY.triangles)
    alone = near_body(TUBE, [BODY.positions], BODY.triangles)[1]
    assert len(triangles) > len(alone)
    np.testing.assert_allclose(frames[0] - frames[1], np.tile([0.0, 0.0, 0.3], (len(frames[0]), 1)), atol=1e-15)


def test_of_a_body_far_away_all_is_kept():
    frames, triangles = near_body(TUBE + 5.0, [BODY.positions], BODY.triangles)
    assert triangles is BODY.triangles
    assert frames[0] is BODY.positions
