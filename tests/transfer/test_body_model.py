"""Skinned body against closed forms, and against the mannequin's own shapes and poses."""

import numpy as np
import pytest

from transfer.body_file import body_model
from transfer.body_model import joint_transforms, pose_feature, rotation_matrices
from transfer.errors import TransferError


def small_arrays(seed=0, n=40, k=3):
    """A chain of three joints along x inside a cloud of n points, keys as in SMPL's files; joints by regression."""
    rng = np.random.default_rng(seed)
    j = 3
    points = rng.uniform(-1, 1, (n, 3))
    joints = np.array([[-1.0, 0, 0], [0, 0, 0], [1, 0, 0]])
    system = np.column_stack([np.ones(n), points])
    regressor = np.stack([np.linalg.lstsq(system.T, np.append(1, place), rcond=None)[0] for place in joints])
    weights = rng.uniform(0, 1, (n, j)) ** 4
    return {
        "v_template": points,
        "shapedirs": 0.1 * rng.standard_normal((n, 3, k)),
        "posedirs": 0.1 * rng.standard_normal((n, 3, 9 * (j - 1))),
        "J_regressor": regressor,
        "weights": weights / weights.sum(axis=1, keepdims=True),
        "kintree_table": np.array([[2**32 - 1, 0, 1], [0, 1, 2]], np.uint32),
        "f": np.array([[0, 1, 2], [3, 4, 5]], np.uint32),
    }


QUARTER = np.array([0, 0, np.pi / 2])
"""A quarter turn about z: (x, y, z) goes to (-y, x, z)."""


def test_at_zero_pose_it_is_template_and_shape():
    arrays = small_arrays()
    model = body_model(arrays)
    beta = np.array([1.0, -2.0, 0.5])
    expected = arrays["v_template"] + sum(b * arrays["shapedirs"][:, :, k] for k, b in enumerate(beta))
    np.testing.assert_allclose(model.vertices(beta), expected, atol=1e-14)
    np.testing.assert_allclose(model.vertices(beta, np.zeros((3, 3))), expected, atol=1e-14)
    np.testing.assert_array_equal(model.vertices(beta[:1]), model.vertices([1.0, 0, 0]))
    np.testing.assert_array_equal(model.parents, [-1, 0, 1])


def test_the_root_moves_the_body_rigidly_about_its_joint():
    model = body_model(small_arrays())
    beta, theta = [0.3, 0.2, 0.1], np.zeros((3, 3))
    theta[0] = QUARTER
    rest, root = model.shaped(beta), model.joints(beta)[0]
    turned = model.vertices(beta, theta, [1, 2, 3])
    np.testing.assert_allclose(turned - root - [1, 2, 3], (rest - root)[:, [1, 0, 2]] * (-1, 1, 1), atol=1e-12)


def test_one_joint_turned_by_a_right_angle():
    arrays = small_arrays()
    arrays["posedirs"] = 0 * arrays["posedirs"]
    arrays["weights"] = np.eye(3)[np.arange(40) % 3]
    model = body_model(arrays)
    theta = np.zeros((3, 3))
    theta[1] = QUARTER
    rest, turned, joint = arrays["v_template"], model.vertices((), theta), model.joints()[1]
    expected = np.where(np.arange(40)[:, None] % 3 == 0, rest, joint + (rest - joint)[:, [1, 0, 2]] * (-1, 1, 1))
    np.testing.assert_allclose(turned, expected, atol=1e-12)


def test_joints_are_regressed_from_the_shaped_mesh():
    arrays = small_arrays()
    model = body_model(arrays)
    beta = [2.0, 0, 0]
    expected = arrays["J_regressor"] @ (arrays["v_template"] + 2 * arrays["shapedirs"][:, :, 0])
    np.testing.assert_allclose(model.joints(beta), expected, atol=1e-12)
    assert np.abs(expected - model.joints()).max() > 1e-3


def test_the_pose_feature_leaves_the_root_out_and_runs_row_by_row():
    theta = np.stack([QUARTER, QUARTER, 0 * QUARTER])
    feature = pose_feature(rotation_matrices(theta))
    np.testing.assert_allclose(feature, [-1, -1, 0, 1, -1, 0, 0, 0, 0] + 9 * [0], atol=1e-15)
    arrays = small_arrays()
    model = body_model(arrays)
    np.testing.assert_allclose(model.pose_offsets(theta), arrays["posedirs"] @ feature, atol=1e-14)
    theta[1] = 0
    np.testing.assert_array_equal(model.pose_offsets(theta), 0 * arrays["v_template"])


def test_a_chain_of_turns_adds_up():
    joints = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]])
    rotations, moves = joint_transforms(rotation_matrices(np.stack([QUARTER] * 3)), joints, np.array([-1, 0, 1]))
    np.testing.assert_allclose(rotations[2] @ [3, 0, 0] + moves[2], [-1, 0, 0], atol=1e-14)


def test_rotations_are_those_of_scipy():
    from scipy.spatial.transform import Rotation

    vectors = np.random.default_rng(0).standard_normal((20, 3)) * 2
    vectors[0] = 0
    np.testing.assert_allclose(rotation_matrices(vectors), Rotation.from_rotvec(vectors).as_matrix(), atol=1e-14)


@pytest.mark.parametrize(
    ("keywords", "name"),
    [
        ({"beta": np.zeros(4)}, "beta"),
        ({"beta": np.zeros((1, 3))}, "beta"),
        ({"beta": [np.nan]}, "beta"),
        ({"beta": ["tall"]}, "beta"),
        ({"theta": np.zeros(9)}, "theta"),
        ({"theta": np.full((3, 3), np.inf)}, "theta"),
        ({"translation": [1, 2]}, "translation"),
    ],
)
def test_bad_parameters_are_named(keywords, name):
    with pytest.raises(TransferError) as caught:
        body_model(small_arrays()).vertices(**keywords)
    assert str(caught.value).startswith(name)


def test_the_mannequin_is_such_a_body():
    from mannequin_body_arrays import MEASURES, body_arrays

    from clothsim.mesh.generators.mannequin.generator import mannequin
    from clothsim.mesh.generators.mannequin.pose import POSES
    from clothsim.mesh.generators.mannequin.proportions import Proportions, warped_joints
    from clothsim.mesh.generators.mannequin.skeleton import JOINTS

    model = body_model(body_arrays())
    np.testing.assert_allclose(model.joints(), warped_joints(Proportions()), atol=1e-9)
    theta = np.array([POSES["walk"].get(name, np.zeros(3)) for name in JOINTS])
    posed = model.vertices((), theta)
    posed[:, 2] -= posed[:, 2].min()
    np.testing.assert_allclose(posed, mannequin(pose="walk")[0], atol=1e-5)
    beta = np.zeros(len(MEASURES))
    beta[MEASURES.index("height")] = 0.2
    np.testing.assert_allclose(model.vertices(beta), mannequin(height=1.9)[0], atol=1e-5)
    beta[:] = 0
    beta[MEASURES.index("waist")] = 0.2
    np.testing.assert_allclose(model.vertices(beta), mannequin(waist=1.2)[0], atol=1e-3)
