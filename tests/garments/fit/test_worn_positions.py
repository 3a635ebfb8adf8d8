"""Place of a garment on another body: exact for rigid motions and for a capsule that becomes wider."""

import numpy as np
from fitting_cases import capsule_figure, tube_garment, wider

from clothsim.garments.fit.transfer_seed import worn_positions
from clothsim.mesh.body import rotation_matrix
from transfer.signed_distance import body_surface

BODY = capsule_figure(segments=24)
SURFACE = body_surface(BODY.positions, BODY.triangles)
TUBE = tube_garment(0.13).positions


def test_the_same_body_leaves_the_garment_where_it_is():
    np.testing.assert_allclose(worn_positions(TUBE, SURFACE, BODY.positions), TUBE, atol=1e-12)


def test_a_body_that_stands_elsewhere_and_turned_takes_the_garment_along():
    turn = rotation_matrix(np.array([0.3, -2.0, 0.7]))
    moved = BODY.positions @ turn.T + [0.0, 1.85, -3.0]
    np.testing.assert_allclose(worn_positions(TUBE, SURFACE, moved), TUBE @ turn.T + [0.0, 1.85, -3.0], atol=1e-9)


def test_the_distance_from_the_body_is_kept_on_a_wider_one():
    placed = worn_positions(TUBE, SURFACE, wider(BODY, 1.5).positions)
    radius = np.linalg.norm(placed[:, :2], axis=1)
    np.testing.assert_allclose(radius, 0.15 + 0.03, atol=2e-3)
    np.testing.assert_allclose(placed[:, 2], TUBE[:, 2], atol=5e-3)
