"""Characters posed as hand-made skinning: the mannequin, an SMPL-like model, and skeletons with axes of their own."""

import numpy as np
import pytest

from clothsim.base.errors import InputError
from clothsim.files.characters.character import Character, mannequin_character, model_character, smpl_character
from clothsim.files.characters.skeleton import (
    Pose,
    Skeleton,
    from_matrices,
    from_rotation_vectors,
    product,
    slerp,
    to_matrices,
    to_rotation_vectors,
)
from clothsim.mesh.body import rotation_matrix
from clothsim.mesh.generators.mannequin.generator import mannequin, turns_of
from transfer.body_model import body_model

RNG = np.random.default_rng(11)


def smpl_like(n=30, j=5):
    rng = np.random.default_rng(3)
    regressor, weights = rng.uniform(0, 1, (j, n)), rng.uniform(0, 1, (n, j))
    return {
        "v_template": rng.standard_normal((n, 3)),
        "shapedirs": 0.1 * rng.standard_normal((n, 3, 3)),
        "posedirs": 0.01 * rng.standard_normal((n, 3, 9 * (j - 1))),
        "J_regressor": regressor / regressor.sum(axis=1, keepdims=True),
        "weights": weights / weights.sum(axis=1, keepdims=True),
        "kintree_table": np.array([[-1, 0, 0, 2, 3][:j], list(range(j))]),
        "f": np.array([[0, 1, 2], [2, 1, 3]]),
    }


@pytest.mark.parametrize("vector", [[0, 0, 0], [1e-9, 0, 0], [0.3, -2, 1], [0, 3.1, 0], [0, 0, np.pi], [2, 2, 0]])
def test_quaternions_and_matrices_of_rotation_vectors(vector):
    quaternion = from_rotation_vectors(np.array(vector, float))
    matrix = rotation_matrix(np.array(vector, float))
    np.testing.assert_allclose(to_matrices(quaternion), matrix, atol=1e-15)
    np.testing.assert_allclose(to_matrices(from_matrices(matrix)), matrix, atol=1e-14)
    if np.linalg.norm(vector) < 3:
        np.testing.assert_allclose(to_rotation_vectors(quaternion), vector, atol=1e-14)


def test_products_are_compositions():
    first, second = from_rotation_vectors(RNG.standard_normal((2, 6, 3)))
    np.testing.assert_allclose(
        to_matrices(product(first, second)), to_matrices(first) @ to_matrices(second), atol=1e-14
    )


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-7, 0.4, 2.9])
@pytest.mark.parametrize("sign", [1, -1])
def test_slerp_turns_at_a_constant_rate_on_the_shorter_arc(angle, sign):
    axis = np.array([1.0, 2.0, -2.0]) / 3
    start = from_rotation_vectors(np.array([0.2, 0.1, 0.5]))
    end = sign * product(start, from_rotation_vectors(angle * axis))
    found = slerp(start, end, 0.3)
    np.testing.assert_allclose(to_matrices(found), to_matrices(start) @ rotation_matrix(0.3 * angle * axis), atol=1e-14)


@pytest.mark.parametrize("measures", [{}, {"height": 1.4}, {"height": 2.1, "chest": 1.1, "limb_girth": 0.9}])
@pytest.mark.parametrize("pose", ["a", "t", "walk", "reach"])
def test_the_mannequin_is_the_mannequin(measures, pose):
    character = mannequin_character(**measures)
    positions, triangles = mannequin(**measures, pose=pose)
    posed = character.vertices(character.skeleton.turned(turns_of(pose, None)))
    np.testing.assert_array_equal(character.triangles, triangles)
    np.testing.assert_allclose(posed - (0, 0, posed[:, 2].min()), positions, atol=1e-12)


def test_an_unknown_measure_is_named():
    with pytest.raises(InputError, match="bust"):
        mannequin_character(bust=1.1)


def test_a_body_model_is_posed_as_the_body_model(tmp_path):
    np.savez(tmp_path / "model.npz", **smpl_like())
    beta, theta = [0.4, -1.0], 0.5 * RNG.standard_normal((5, 3))
    character = smpl_character(tmp_path / "model.npz", beta)
    turns = dict(zip(character.skeleton.names, theta, strict=True))
    wanted = body_model(smpl_like()).vertices(beta, theta)
    np.testing.assert_allclose(character.vertices(character.skeleton.turned(turns)), wanted, atol=1e-12)


def test_too_many_shape_parameters_are_refused():
    with pytest.raises(InputError, match="at most 3"):
        model_character(body_model(smpl_like()), [0, 0, 0, 1])


def test_turns_are_in_the_axes_of_the_space_whatever_axes_a_joint_has():
    axes = [rotation_matrix(np.array(v, float)) for v in ([0.4, 0, 1], [1, -2, 0.3])]
    positions = np.array([[0.1, 0.2, 0.3], [0.5, 0.9, -0.2]])
    rest = Pose(
        np.array([positions[0], axes[0].T @ (positions[1] - positions[0])]),
        from_matrices(np.array([axes[0], axes[0].T @ axes[1]])),
        np.ones((2, 3)),
    )
    skeleton = Skeleton(("root", "tip"), np.array([-1, 0]), rest)
    turn = {"root": np.array([0.3, 0.2, -0.6]), "tip": np.array([-0.5, 1.0, 0.4])}
    found = skeleton.transforms(skeleton.turned(turn))
    root, tip = rotation_matrix(turn["root"]), rotation_matrix(turn["tip"])
    np.testing.assert_allclose(found[1, :3, :3], root @ tip @ axes[1], atol=1e-13)
    np.testing.assert_allclose(found[1, :3, 3], positions[0] + root @ (positions[1] - positions[0]), atol=1e-13)


def test_joints_that_scale_are_skinned_with_their_scale():
    skeleton = Skeleton(("a",), np.array([-1]), Pose(np.zeros((1, 3)), np.eye(4)[:1], np.ones((1, 3))))
    points = RNG.standard_normal((4, 3))
    body = Character(
        points, np.array([[0, 1, 2]]), np.ones((4, 1)), skeleton, np.array([0]), np.eye(4)[None], np.zeros((4, 3, 0))
    )
    grown = body.vertices(Pose(np.ones((1, 3)), np.eye(4)[:1], np.array([[2.0, 3.0, 4.0]])))
    np.testing.assert_allclose(grown, points * (2, 3, 4) + 1, atol=1e-14)
