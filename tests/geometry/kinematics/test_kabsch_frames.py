"""Kabsch rotations of vertex neighbourhoods."""

import numpy as np
import pytest
from meshes import cloth, grid, irregular_grid, random_rotation

from clothsim.base.errors import InputError
from clothsim.geometry.kinematics.kabsch_frames import vertex_frames
from clothsim.mesh.body import rotation_matrix
from clothsim.mesh.topology import vertex_rings


def curved_sheet():
    positions, triangles = irregular_grid(nx=5, ny=4)
    positions[:, 2] = 0.3 * np.sin(2 * positions[:, 0]) + 0.2 * positions[:, 1] ** 2
    return positions, triangles


def flat_sheet():
    return irregular_grid(nx=5, ny=4)


def one_triangle():
    return np.array([[0, 0, 0], [1, 0, 0.2], [0.3, 0.8, 0]]), np.array([[0, 1, 2]])


SHEETS = {"flat": flat_sheet, "curved": curved_sheet, "one triangle": one_triangle}


def every(matrix, n):
    return np.broadcast_to(matrix, (n, 3, 3))


@pytest.mark.parametrize("degrees", [0, 1e-5, 77, 179.99999, 180])
@pytest.mark.parametrize("sheet", SHEETS)
def test_rigid_motion(sheet, degrees):
    positions, triangles = SHEETS[sheet]()
    rings = vertex_rings(triangles, len(positions))
    R = rotation_matrix(np.radians(degrees) * np.array([2.0, 3.0, 6.0]) / 7)
    frames = vertex_frames(positions, positions @ R.T + [5, -6, 7], *rings)
    assert frames.collinear.tolist() == []
    np.testing.assert_allclose(frames.rotations, every(R, len(positions)), rtol=0, atol=1e-13)


def test_a_mirrored_flat_sheet_is_turned_over():
    positions, triangles = flat_sheet()
    frames = vertex_frames(positions, positions * [1, -1, 1], *vertex_rings(triangles, len(positions)))
    assert frames.collinear.size == 0
    np.testing.assert_allclose(frames.rotations, every(np.diag([1, -1, -1]), len(positions)), rtol=0, atol=1e-13)


def test_rotations_against_one_svd_per_vertex():
    """A mesh with rings of many sizes and a displacement that differs at every vertex."""
    positions, triangles = curved_sheet()
    deformed = positions + 0.2 * np.random.default_rng(0).standard_normal(positions.shape)
    starts, neighbours = vertex_rings(triangles, len(positions))
    assert len(np.unique(np.diff(starts))) > 3
    frames = vertex_frames(positions, deformed, starts, neighbours)
    for i in range(len(positions)):
        ring = np.append(neighbours[starts[i] : starts[i + 1]], i)
        P, Q = positions[ring] - positions[ring].mean(0), deformed[ring] - deformed[ring].mean(0)
        A, _, Bt = np.linalg.svd(P.T @ Q)
        expected = Bt.T @ np.diag([1, 1, np.sign(np.linalg.det(Bt.T @ A.T))]) @ A.T
        np.testing.assert_allclose(frames.rotations[i], expected, rtol=0, atol=1e-13)


def test_collinear_neighbourhoods_are_listed():
    """A triangle squeezed to a line beside a sound sheet: the rotation about that line is undetermined."""
    positions, triangles = flat_sheet()
    line = np.outer(np.arange(3.0), [1.0, 2.0, 3.0]) + 2
    both = np.concatenate([positions, line])
    faces = np.concatenate([triangles, [[len(positions), len(positions) + 1, len(positions) + 2]]])
    frames = vertex_frames(both, both, *vertex_rings(faces, len(both)))
    assert frames.collinear.tolist() == [30, 31, 32]
    np.testing.assert_allclose(np.linalg.det(frames.rotations), 1, rtol=1e-13)
    np.testing.assert_allclose(frames.rotations[:30], every(np.eye(3), 30), rtol=0, atol=1e-13)


def test_neighbourhoods_collapsed_onto_a_line_are_listed():
    positions, triangles = grid(3, 3)
    frames = vertex_frames(positions, positions * [1, 0, 0], *vertex_rings(triangles, len(positions)))
    assert frames.collinear.tolist() == list(range(len(positions)))


def test_isolated_vertex_is_collinear_with_the_identity():
    positions, triangles = grid(1, 1)
    positions = np.concatenate([positions, [[9.0, 9.0, 9.0]]])
    frames = vertex_frames(positions, positions @ random_rotation(1).T, *vertex_rings(triangles, 5))
    assert frames.collinear.tolist() == [4]
    np.testing.assert_array_equal(frames.rotations[4], np.eye(3))


def test_neighbourhood_includes_the_vertex_itself():
    """The corner of a lone triangle: two neighbours are a line, with the vertex itself they fix the rotation."""
    positions, triangles = one_triangle()
    R = random_rotation(5)
    frames = vertex_frames(positions, positions @ R.T, *vertex_rings(triangles, 3))
    assert frames.collinear.size == 0
    np.testing.assert_allclose(frames.rotations, every(R, 3), rtol=0, atol=1e-14)


def test_undeformed_cloth_has_identity_frames():
    sheet = cloth(*curved_sheet())
    rings = vertex_rings(sheet.triangles, len(sheet.positions))
    frames = vertex_frames(sheet.rest_positions, sheet.positions, *rings)
    np.testing.assert_allclose(frames.rotations, every(np.eye(3), len(sheet.positions)), rtol=0, atol=1e-14)


def test_bad_input_is_named():
    positions, triangles = grid(2, 2)
    starts, neighbours = vertex_rings(triangles, 9)
    with pytest.raises(InputError, match=r"reference .*9.*deformed.* 8"):
        vertex_frames(positions, positions[:-1], starts, neighbours)
    with pytest.raises(InputError, match="starts"):
        vertex_frames(positions, positions, starts[:-1], neighbours)
    with pytest.raises(InputError, match=r"neighbours\[2\] = 9 .* 0\.\.8"):
        vertex_frames(positions, positions, starts, np.where(np.arange(len(neighbours)) == 2, 9, neighbours))
    with pytest.raises(InputError, match=r"deformed\[3, 0\]"):
        vertex_frames(positions, np.where(np.arange(27).reshape(9, 3) == 9, np.nan, positions), starts, neighbours)
