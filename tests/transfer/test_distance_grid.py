"""Signed distance on a grid against that of a sphere."""

import numpy as np
import pytest
import trimesh

from transfer.drape_autoencoder_training import distance_grid
from transfer.errors import TransferError
from transfer.signed_distance import body_surface

SPHERE = trimesh.creation.icosphere(4)
BODY = body_surface(SPHERE.vertices, SPHERE.faces)


def test_nodes_are_exact_and_between_them_the_error_falls_as_the_square_of_the_spacing():
    points = np.random.default_rng(0).uniform([-0.4, -0.4, 0.5], [0.4, 0.4, 1.3], (200, 3))
    exact = BODY.closest(points).signed_distance
    errors = []
    for spacing in (0.1, 0.05):
        grid = distance_grid(BODY, points, spacing)
        node = grid.origin + spacing * np.array([3, 2, 1])
        assert grid.signed_distance([node])[0] == pytest.approx(BODY.closest([node]).signed_distance[0], abs=1e-12)
        errors.append(np.sqrt(np.mean((grid.signed_distance(points) - exact) ** 2)))
    assert errors[0] < 2e-3
    assert errors[1] < 0.4 * errors[0]


def test_outside_of_the_grid_the_boundary_counts():
    grid = distance_grid(BODY, [[0, 0, 1.0]], 0.05, 0.09)
    end = grid.origin[2] + 0.05 * (grid.values.shape[2] - 1)
    assert grid.signed_distance([[0, 0, 9.0]])[0] == pytest.approx(grid.signed_distance([[0, 0, end]])[0])
    assert end >= 1.09


@pytest.mark.parametrize(("spacing", "margin"), [(0.0, 0.1), (1e-4, 0.1), (0.1, -1.0)])
def test_bad_sizes_are_refused(spacing, margin):
    with pytest.raises(TransferError):
        distance_grid(BODY, [[0, 0, 1.0]], spacing, margin)
