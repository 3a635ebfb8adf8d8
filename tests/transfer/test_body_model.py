"""Skinned body against closed forms, and against the mannequin's own shapes and poses.

SMPL-like files: read back exactly, and each fault refused with one sentence.
"""

import numpy as np
import pytest

from transfer.body_model import KEYS, body_model, joint_transforms, pose_feature, read_body_model, rotation_matrices
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

    from clothsim.keys.generator_keys import Proportions
    from clothsim.mesh.generators.mannequin.generator import JOINTS, POSES, mannequin, warped_joints

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


def arrays(n=12, k=2, j=4):
    rng = np.random.default_rng(3)
    regressor, weights = rng.uniform(0, 1, (j, n)), rng.uniform(0, 1, (n, j))
    return {
        "v_template": rng.standard_normal((n, 3)).astype(np.float32),
        "shapedirs": rng.standard_normal((n, 3, k)).astype(np.float32),
        "posedirs": rng.standard_normal((n, 3, 9 * (j - 1))).astype(np.float32),
        "J_regressor": regressor / regressor.sum(axis=1, keepdims=True),
        "weights": (weights / weights.sum(axis=1, keepdims=True)).astype(np.float32),
        "kintree_table": np.array([[2**32 - 1, 0, 0, 2], [0, 1, 2, 3]], np.uint32),
        "f": np.array([[0, 1, 2], [2, 1, 3]], np.uint32),
    }


def test_a_file_is_read_as_it_was_written(tmp_path):
    written = arrays()
    np.savez(tmp_path / "body.npz", **written, gender="neutral")
    model = read_body_model(tmp_path / "body.npz")
    np.testing.assert_array_equal(model.template, written["v_template"])
    np.testing.assert_array_equal(model.triangles, written["f"])
    np.testing.assert_array_equal(model.parents, [-1, 0, 0, 2])
    np.testing.assert_allclose(model.weights.sum(axis=1), 1, atol=1e-15)
    assert model.template.dtype == np.float64
    assert model.triangles.dtype == np.int64
    np.testing.assert_allclose(model.vertices(), written["v_template"])


@pytest.mark.parametrize("root", [-1, 2**32 - 1])
@pytest.mark.parametrize("kind", [np.int64, np.uint32, np.int32])
def test_the_root_is_known_in_every_integer_type(root, kind):
    changed = arrays()
    changed["kintree_table"] = np.array([[root, 10, 10, 12], [10, 11, 12, 13]], np.int64).astype(kind)
    np.testing.assert_array_equal(body_model(changed).parents, [-1, 0, 0, 2])


@pytest.mark.parametrize("key", KEYS)
def test_a_missing_key_is_named(tmp_path, key):
    left = {name: value for name, value in arrays().items() if name != key}
    np.savez(tmp_path / "body.npz", **left)
    with pytest.raises(TransferError, match=rf"body\.npz.*'{key}'"):
        read_body_model(tmp_path / "body.npz")


class Bomb:
    def __reduce__(self):
        return (pytest.fail, ("the pickle was run",))


def test_pickles_are_refused_unread(tmp_path):
    changed = arrays()
    changed["J_regressor"] = np.array([Bomb()], object)
    np.savez(tmp_path / "body.npz", **changed)
    with pytest.raises(TransferError, match=r"'J_regressor'.*body\.npz"):
        read_body_model(tmp_path / "body.npz")


def test_a_pickle_file_is_refused_unread(tmp_path):
    import pickle

    (tmp_path / "body.pkl").write_bytes(pickle.dumps(Bomb()))
    with pytest.raises(TransferError, match=r"body\.pkl.*npz"):
        read_body_model(tmp_path / "body.pkl")


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04broken", b"hello", b"\x93NUMPY"])
def test_what_is_no_file_of_arrays_is_refused(tmp_path, content):
    (tmp_path / "body.npz").write_bytes(content)
    with pytest.raises(TransferError, match=r"body\.npz"):
        read_body_model(tmp_path / "body.npz")


def test_a_cut_file_is_refused(tmp_path):
    np.savez_compressed(tmp_path / "body.npz", **arrays())
    whole = (tmp_path / "body.npz").read_bytes()
    damaged = bytearray(whole)
    damaged[60:90] = b"\xff" * 30
    for content in (whole[: len(whole) // 2], bytes(damaged)):
        (tmp_path / "body.npz").write_bytes(content)
        with pytest.raises(TransferError):
            read_body_model(tmp_path / "body.npz")


def test_no_file_and_one_array(tmp_path):
    with pytest.raises(TransferError, match=r"body\.npz"):
        read_body_model(tmp_path / "body.npz")
    np.save(tmp_path / "body.npy", np.zeros(3))
    with pytest.raises(TransferError, match=r"body\.npy"):
        read_body_model(tmp_path / "body.npy")


def changed(key, change):
    made = arrays()
    made[key] = change(made[key])
    return made


def put(*index_and_value):
    *index, value = index_and_value

    def change(array):
        array = array.copy()
        array[tuple(index)] = value
        return array

    return change


@pytest.mark.parametrize(
    ("key", "change", "names"),
    [
        ("v_template", lambda a: a[:, :2], ["v_template", "(12, 2)"]),
        ("v_template", put(3, 1, np.nan), ["v_template[3, 1]"]),
        ("v_template", lambda a: a.astype(str), ["v_template"]),
        ("shapedirs", lambda a: a[:5], ["shapedirs", "(5, 3, 2)"]),
        ("shapedirs", lambda a: a[:, :, 0], ["shapedirs", "(12, 3)"]),
        ("posedirs", lambda a: a[:, :, :9], ["posedirs", "(12, 3, 27)", "(12, 3, 9)"]),
        ("J_regressor", lambda a: a.T, ["J_regressor", "(4, 12)", "(12, 4)"]),
        ("J_regressor", lambda a: 2 * a, ["J_regressor[0]", "2"]),
        ("weights", lambda a: a[:, :3], ["weights", "(12, 4)", "(12, 3)"]),
        ("weights", lambda a: a + np.array([1, -1, 0, 0]), ["weights[0, 1]", "-"]),
        ("weights", lambda a: 0 * a, ["weights[0]", "0"]),
        ("kintree_table", lambda a: a[0], ["kintree_table", "(2, j)"]),
        ("kintree_table", lambda a: a.astype(float), ["kintree_table"]),
        ("kintree_table", put(0, 1, 3), ["kintree_table", "1", "3"]),
        ("kintree_table", put(0, 1, 9), ["kintree_table", "1", "9"]),
        ("kintree_table", put(0, 2, 2**32 - 1), ["kintree_table", "2"]),
        ("kintree_table", put(1, 2, 1), ["kintree_table"]),
        ("f", put(1, 2, 12), ["triangle 1", "[2, 1, 12]", "0..11"]),
        ("f", lambda a: a.astype(float), ["triangles"]),
        ("f", lambda a: a.ravel(), ["triangles", "(m, 3)"]),
    ],
)
def test_arrays_that_do_not_fit_are_named(key, change, names):
    with pytest.raises(TransferError) as caught:
        body_model(changed(key, change))
    assert all(name in str(caught.value) for name in names), caught.value
