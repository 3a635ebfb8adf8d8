"""Frame of a body: the same in every orientation, upright, to its front; other surfaces are refused."""

import numpy as np
import pytest
from real_data import DATA, needs_data

from clothsim.garments.inputs import BodyMesh
from clothsim.mesh.generators.table import GENERATORS
from transfer.body_frame import body_frame, level_set
from transfer.errors import TransferError

MANNEQUIN = GENERATORS["mannequin"]()
BODIES = ("mean_all", "mean_all_tpose", "mean_female", "f_smpl_average_A40")


def turned_about(axis, degrees):
    """Rotation matrix about a unit vector."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = np.radians(degrees)
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def test_the_mannequin_stands_on_z_and_looks_along_minus_y():
    frame = body_frame(*MANNEQUIN)
    np.testing.assert_allclose(frame.axes, [[1, 0, 0], [0, 0, 1], [0, -1, 0]], atol=0.02)
    np.testing.assert_allclose(np.linalg.det(frame.axes), 1.0)
    np.testing.assert_allclose(frame.height, np.ptp(MANNEQUIN[0][:, 2]))


@pytest.mark.parametrize("degrees", [37, 90, 180, 270])
def test_a_turned_body_has_its_frame_turned(degrees):
    turn = turned_about([0, 0, 1], degrees)
    frame = body_frame(MANNEQUIN[0] @ turn.T + [0.3, -2.0, 0.1], MANNEQUIN[1])
    np.testing.assert_allclose(frame.axes, body_frame(*MANNEQUIN).axes @ turn.T, atol=1e-9)


@pytest.mark.parametrize("degrees", [0, 130])
def test_a_body_in_a_stride_looks_where_its_feet_point(degrees):
    turn = turned_about([0, 0, 1], degrees)
    positions, triangles = GENERATORS["mannequin"](pose="walk")
    frame = body_frame(positions @ turn.T, triangles)
    np.testing.assert_allclose(frame.front, turn @ [0, -1, 0], atol=0.05)


def test_y_up_is_found_with_level_arms_along_z():
    level = GENERATORS["mannequin"](pose="t")
    upright = body_frame(*level).local(level[0])
    sideways = upright[:, [2, 1, 0]] * [1, 1, -1]  # y up, arms along z
    frame = body_frame(sideways, MANNEQUIN[1])
    np.testing.assert_allclose(frame.up, [0, 1, 0])
    np.testing.assert_allclose(frame.front, [1, 0, 0], atol=0.02)
    assert BodyMesh("sideways", sideways, MANNEQUIN[1], 1.0, ()).up.tolist() == [0, 1, 0]


def test_a_ball_is_no_standing_body():
    with pytest.raises(TransferError, match="legs"):
        body_frame(*GENERATORS["sphere"](subdivisions=2))


@needs_data
@pytest.mark.parametrize("name", BODIES)
def test_real_bodies_look_along_z(name):
    from clothsim.files.meshes.mesh_file import read_mesh

    mesh = read_mesh(DATA / "bodies" / f"{name}.obj")
    np.testing.assert_allclose(body_frame(mesh.positions, mesh.triangles).axes, np.eye(3), atol=0.02)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_level_crosses_triangles_with_finite_values_on_both_sides(bad):
    """The level itself counts as below: of triangles that touch it, those from above are crossed."""
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    values = np.array([[-1.0, 1.0, 2.0], [1.0, 2.0, 3.0], [-1.0, -2.0, -3.0], [0.0, 1.0, 1.0], [0.0, -1.0, -1.0]])
    values = np.concatenate([values, [[-1.0, 1.0, bad], [bad, bad, bad]]])
    points = np.concatenate([np.column_stack([corners, heights]) for heights in np.nan_to_num(values)])
    curve = level_set(points, np.arange(len(points)).reshape(-1, 3), values.ravel(), 0.0)
    assert curve.triangles.tolist() == [0, 3]
    assert np.abs(curve.starts[:, 2]).max() < 1e-15
    assert np.abs(curve.ends[:, 2]).max() < 1e-15
