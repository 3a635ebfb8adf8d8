"""BVH, AMASS and glTF motion: poses as by hand, retargeted limbs within a degree, faults in one sentence."""

import numpy as np
import pytest
from glb_files import two_bones
from motion_files import JOINTS, bvh_text, random_angles, world_turns

from clothsim.base.errors import InputError
from clothsim.files.characters.character import SMPL_JOINTS, mannequin_character, model_character
from clothsim.files.characters.gltf_character import read_character
from clothsim.files.characters.motion_files import read_amass, read_animation, read_bvh, t_pose
from clothsim.files.characters.retarget import retargeted
from clothsim.files.characters.skeleton import from_rotation_vectors, joint_roles, to_matrices
from clothsim.mesh.body import rotation_matrix
from transfer.body_model import body_model

FRAMES = 5
ROOT = np.linspace([0, 38, 0], [10, 39, 30], FRAMES)
LIMBS = ("LeftArm LeftForeArm", "RightArm RightForeArm", "LeftUpLeg LeftLeg", "LeftLeg LeftFoot", "RightUpLeg RightLeg")
ROLES = {
    "LeftArm": "left_shoulder", "LeftForeArm": "left_elbow", "RightArm": "right_shoulder",
    "RightForeArm": "right_elbow", "LeftUpLeg": "left_hip", "LeftLeg": "left_knee", "LeftFoot": "left_ankle",
    "RightUpLeg": "right_hip", "RightLeg": "right_knee",
}  # fmt: skip
TO_MANNEQUIN = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0.0]])
"""From y up and facing +z to z up and facing -y."""


def clip_of(tmp_path, order, seed=1):
    angles = random_angles(seed, FRAMES)
    (tmp_path / "m.bvh").write_text(bvh_text(angles, order, ROOT))
    return read_bvh(tmp_path / "m.bvh"), angles


@pytest.mark.parametrize("order", ["ZXY", "XYZ", "YZX"])
def test_bvh_channels_in_their_own_order(tmp_path, order):
    clip, angles = clip_of(tmp_path, order)
    assert clip.duration == pytest.approx(0.04 * (FRAMES - 1))
    for frame in (0, 2, 4):
        turns = world_turns(angles, order, frame)
        found = clip.skeleton.transforms(clip.pose(0.04 * frame))
        for row, name in enumerate(clip.skeleton.names):
            np.testing.assert_allclose(found[row, :3, :3], turns[name], atol=1e-6)
    np.testing.assert_allclose(found[0, :3, 3], ROOT[4], atol=1e-8)


def test_between_frames_a_single_axis_turns_evenly(tmp_path):
    angles = {name: np.zeros((2, 3)) for name in JOINTS}
    angles["LeftArm"][1] = (80, 0, 0)
    (tmp_path / "m.bvh").write_text(bvh_text(angles, "ZXY", ROOT[:2]))
    clip = read_bvh(tmp_path / "m.bvh")
    row = clip.skeleton.names.index("LeftArm")
    wanted = rotation_matrix(np.radians([0, 0, 20.0]))
    np.testing.assert_allclose(to_matrices(clip.pose(0.01).rotations[row]), wanted, atol=1e-9)


@pytest.mark.parametrize(("order", "seed"), [("ZXY", 1), ("XYZ", 2), ("YXZ", 3), ("ZYX", 4)])
def test_limbs_point_as_in_a_bvh_in_inches(tmp_path, order, seed):
    clip, angles = clip_of(tmp_path, order, seed)
    target = mannequin_character(height=1.8).skeleton
    motion = retargeted(clip, target)
    for frame in (0, 3, 4):
        turns = world_turns(angles, order, frame)
        at = target.transforms(motion.pose(0.04 * frame))[:, :3, 3]
        for limb in LIMBS:
            start, end = limb.split()
            bone = at[target.names.index(ROLES[end])] - at[target.names.index(ROLES[start])]
            wanted = TO_MANNEQUIN @ turns[start] @ np.array(JOINTS[end][1], float)
            cosine = bone @ wanted / np.linalg.norm(bone) / np.linalg.norm(wanted)
            assert np.degrees(np.arccos(min(cosine, 1.0))) < 1e-3


def test_the_hips_travel_by_the_ratio_of_the_thighs(tmp_path):
    clip, _ = clip_of(tmp_path, "ZXY")
    target = mannequin_character().skeleton
    motion = retargeted(clip, target)
    thigh = np.linalg.norm(target.rest_positions()[target.names.index("left_knee")]
                           - target.rest_positions()[target.names.index("left_hip")])  # fmt: skip
    moved = motion.pose(0.16).translations[0] - motion.pose(0.0).translations[0]
    np.testing.assert_allclose(moved, thigh / 17 * TO_MANNEQUIN @ (ROOT[4] - ROOT[0]), rtol=1e-9)
    in_inches = retargeted(clip, target, 0.0254)
    moved = in_inches.pose(0.16).translations[0] - in_inches.pose(0.0).translations[0]
    np.testing.assert_allclose(moved, 0.0254 * TO_MANNEQUIN @ (ROOT[4] - ROOT[0]), rtol=1e-9)


def test_the_rest_of_a_clip_stands_on_its_feet(tmp_path):
    angles = {name: np.zeros((2, 3)) for name in JOINTS}
    (tmp_path / "m.bvh").write_text(bvh_text(angles, "ZXY", ROOT[[0, 0]] + (0, 7, 0)))
    target = mannequin_character().skeleton
    feet = [target.names.index(f"{side}_ankle") for side in ("left", "right")]
    heights = target.transforms(retargeted(read_bvh(tmp_path / "m.bvh"), target).pose(0))[feet, 2, 3]
    np.testing.assert_allclose(heights.min(), target.rest_positions()[feet, 2].min(), atol=1e-12)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("HIERARCHY", "NOTHING"),
        ("Frames: 5", "Frames: 500000000"),
        ("Frame Time: 0.04", "Frame Time: 0"),
        ("CHANNELS 3 Z", "CHANNELS 3 Q"),
        ("OFFSET 0 5 0", "OFFSET 0 five 0"),
        ("OFFSET 0 5 0", "OFFSET 0 nan 0"),
        ("End Site", "JOINT"),
    ],
)
def test_a_broken_bvh_is_named(tmp_path, old, new):
    text = bvh_text(random_angles(1, FRAMES), "ZXY", ROOT)
    assert old in text
    cut = text.replace(old, new, 1) if old != "End Site" else text.replace("}", "", 1)
    (tmp_path / "bad.bvh").write_text(cut)
    with pytest.raises(InputError, match=r"bad\.bvh"):
        read_bvh(tmp_path / "bad.bvh")


def test_a_brace_may_stand_behind_the_name(tmp_path):
    text = bvh_text(random_angles(1, FRAMES), "ZXY", ROOT)
    (tmp_path / "behind.bvh").write_text(text.replace("JOINT Spine\n  {", "JOINT Spine {", 1))
    assert "JOINT Spine {" in (tmp_path / "behind.bvh").read_text()
    assert read_bvh(tmp_path / "behind.bvh").skeleton.names[1] == "Spine"


def test_a_second_root_inside_of_the_first_is_a_joint_of_it(tmp_path):
    text = bvh_text(random_angles(1, FRAMES), "ZXY", ROOT)
    (tmp_path / "two.bvh").write_text(text.replace("JOINT Spine\n", "ROOT Spine\n", 1))
    assert read_bvh(tmp_path / "two.bvh").skeleton.names[1] == "Spine"


def amass(path, joints=52, **changed):
    rng = np.random.default_rng(6)
    poses = 0.4 * rng.standard_normal((4, 3 * joints))
    poses[:, :3] = (np.pi / 2, 0, 0)
    arrays = {
        "poses": poses,
        "trans": rng.standard_normal((4, 3)),
        "mocap_framerate": 120.0,
        "gender": np.array("neutral", object),
    }
    arrays |= changed
    np.savez(path, **{name: value for name, value in arrays.items() if value is not None})
    return arrays


def smpl_like(joints=24):
    rng = np.random.default_rng(3)
    weights = rng.uniform(0, 1, (40, joints))
    regressor = rng.uniform(0, 1, (joints, 40))
    return body_model({
        "v_template": rng.standard_normal((40, 3)), "shapedirs": np.zeros((40, 3, 1)),
        "posedirs": 0.01 * rng.standard_normal((40, 3, 9 * (joints - 1))),
        "J_regressor": regressor / regressor.sum(axis=1, keepdims=True),
        "weights": weights / weights.sum(axis=1, keepdims=True),
        "kintree_table": np.array([[-1, *range(joints - 1)], range(joints)]), "f": np.array([[0, 1, 2]]),
    })  # fmt: skip


def test_amass_moves_a_body_model_as_the_model_itself(tmp_path):
    arrays = amass(tmp_path / "m.npz", joints=24)
    model = smpl_like()
    character = model_character(model)
    clip = read_amass(tmp_path / "m.npz", character.skeleton)
    for frame in (0, 3):
        wanted = model.vertices((), arrays["poses"][frame].reshape(24, 3), arrays["trans"][frame])
        y_up = np.stack([wanted[:, 0], wanted[:, 2], -wanted[:, 1]], axis=1)
        np.testing.assert_allclose(character.vertices(clip.pose(frame / 120)), y_up, atol=1e-12)


def test_amass_of_other_hands_moves_the_common_joints(tmp_path):
    arrays = amass(tmp_path / "m.npz", joints=52)
    clip = read_amass(tmp_path / "m.npz", model_character(smpl_like(55)).skeleton)
    wanted = from_rotation_vectors(arrays["poses"][2].reshape(52, 3)[1:22])
    np.testing.assert_allclose(clip.pose(2 / 120).rotations[1:22], wanted, atol=1e-14)
    np.testing.assert_allclose(clip.pose(2 / 120).rotations[22:], np.tile([1, 0, 0, 0], (33, 1)))


def test_amass_on_the_mannequin_points_its_thighs(tmp_path):
    arrays = amass(tmp_path / "m.npz")
    target = mannequin_character().skeleton
    motion = retargeted(read_amass(tmp_path / "m.npz"), target)
    hip = rotation_matrix(arrays["poses"][1, :3]) @ rotation_matrix(arrays["poses"][1, 3:6])
    at = target.transforms(motion.pose(1 / 120))[:, :3, 3]
    roles = joint_roles(SMPL_JOINTS, t_pose().parents.tolist())
    bone = t_pose().rest_positions()[roles["left_knee"]] - t_pose().rest_positions()[roles["left_hip"]]
    wanted = hip @ bone  # AMASS is z up and looks along -y, as the mannequin
    found = at[target.names.index("left_knee")] - at[target.names.index("left_hip")]
    np.testing.assert_allclose(found / np.linalg.norm(found), wanted / np.linalg.norm(wanted), atol=1e-9)


@pytest.mark.parametrize(
    "changed",
    [
        {"trans": None},
        {"mocap_framerate": None},
        {"mocap_framerate": 0.0},
        {"poses": np.zeros((4, 60))},
        {"poses": np.full((4, 156), np.nan)},
        {"poses": np.array([object()])},
        {"trans": np.zeros((3, 3))},
    ],
)
def test_a_broken_amass_file_is_named(tmp_path, changed):
    amass(tmp_path / "bad.npz", **changed)
    with pytest.raises(InputError, match=r"bad\.npz"):
        read_amass(tmp_path / "bad.npz")


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 no", b"\x80\x04pickle"])
def test_no_archive_is_named(tmp_path, content):
    (tmp_path / "bad.npz").write_bytes(content)
    with pytest.raises(InputError, match=r"bad\.npz"):
        read_amass(tmp_path / "bad.npz")


QUARTER = [0, 0, np.sin(np.pi / 4), np.cos(np.pi / 4)]


@pytest.mark.parametrize(
    ("interpolation", "values", "time", "degrees"),
    [
        ("LINEAR", [[0, 0, 0, 1], QUARTER], 0.5, 22.5),
        ("STEP", [[0, 0, 0, 1], QUARTER], 1.9, 0.0),
        ("LINEAR", [[0, 0, 0, 1], QUARTER], 5.0, 90.0),
        ("CUBICSPLINE", [[0] * 4, [0, 0, 0, 1], [0] * 4, [0] * 4, QUARTER, [0] * 4], 1.0, 45.0),
    ],
)
def test_gltf_animations(tmp_path, interpolation, values, time, degrees):
    path = tmp_path / "bar.glb"
    path.write_bytes(two_bones(keys=(np.array([0.0, 2.0]), np.array(values)), interpolation=interpolation).bytes())
    clip = read_animation(path, read_character(path).skeleton, "wave")
    tip = clip.skeleton.names.index("tip")
    wanted = rotation_matrix(np.radians([0, 0, degrees]))
    np.testing.assert_allclose(to_matrices(clip.pose(time).rotations[tip]), wanted, atol=1e-6)
    assert clip.duration == 2.0


def test_an_animation_that_is_not_there_is_named(tmp_path):
    path = tmp_path / "bar.glb"
    path.write_bytes(two_bones().bytes())
    skeleton = read_character(path).skeleton
    with pytest.raises(InputError, match=r"bar\.glb"):
        read_animation(path, skeleton)
    path.write_bytes(two_bones(keys=(np.array([1.0, 0.5]), np.array([QUARTER, QUARTER]))).bytes())
    with pytest.raises(InputError, match="wave"):
        read_animation(path, skeleton)
    with pytest.raises(InputError, match=r"run.*wave"):
        read_animation(path, skeleton, "run")
