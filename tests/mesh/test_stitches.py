"""Stitches between two lines by arc length, and hinges over a closed seam."""

import numpy as np
import pytest
from meshes import grid

from clothsim.mesh.stitches import hinges_across, line_of, stitches


def along(*parameters, first=0):
    """A line along x with vertices at these places."""
    return line_of(first + np.arange(len(parameters)), np.array([[x, 0.0, 0.0] for x in parameters]))


def test_places_are_fractions_of_the_length():
    corner = line_of(np.array([7, 3, 5]), np.array([[0.0, 0, 0], [3, 0, 0], [3, 1, 0]]))
    assert corner.vertices.tolist() == [7, 3, 5]
    assert corner.parameters.tolist() == [0, 0.75, 1]


@pytest.mark.parametrize("turned", [False, True])
def test_the_finer_line_meets_points_of_the_coarser(turned):
    coarse, fine = along(0, 2), along(0, 1, 4, first=2)
    rows, weights = stitches(fine, coarse) if turned else stitches(coarse, fine)
    assert rows.tolist() == [[2, 0, 1], [3, 0, 1], [4, 0, 1]]
    assert np.allclose(weights, [[1, -1, 0], [1, -0.75, -0.25], [1, 0, -1]])


def test_points_of_equal_fractions_coincide_whatever_the_lengths():
    rng = np.random.default_rng(0)
    parameters = np.sort(rng.random(9))
    first, second = along(*parameters), along(*(5 + 3 * np.sort(rng.random(6))), first=9)
    rows, weights = stitches(first, second)
    share = np.concatenate([first.parameters, second.parameters])
    assert np.abs((weights * share[rows]).sum(axis=1)).max() < 1e-15


def test_hinges_are_there_for_vertices_that_meet_one_to_one():
    positions, triangles = grid(2, 3)
    left, right = (np.flatnonzero(positions[:, 0] == x) for x in (0.0, 1.0))
    first, second = line_of(left, positions[left]), line_of(right, positions[right])
    hinges, beside = hinges_across(first, second, triangles)
    assert len(hinges) == 3
    assert np.isin(hinges[:, :2], left).all()
    assert (positions[hinges[:, 2], 0] <= 0.5).all()
    assert (positions[hinges[:, 3], 0] >= 0.5).all()
    for hinge, (here, there) in zip(hinges, beside, strict=True):
        assert set(hinge[:3]) == set(triangles[here])
        assert hinge[3] in triangles[there]
    uneven = line_of(right[[0, 1, 3]], positions[right[[0, 1, 3]]])
    assert not len(hinges_across(first, uneven, triangles)[0])
