"""Mannequin: sound, symmetric, of one topology, with the requested measures."""

import numpy as np
import pytest

from clothsim.base.errors import InputError
from clothsim.keys.generator_keys import Proportions
from clothsim.mesh.checks import examine
from clothsim.mesh.generators.mannequin.body_limbs import skinning_weights
from clothsim.mesh.generators.mannequin.generator import (
    JOINT_POSITIONS,
    JOINTS,
    LEVELS,
    PARENTS,
    POSES,
    TEMPLATE_HEIGHT,
    TEMPLATE_SOLE,
    joint,
    mannequin,
    mirrored,
    other_side,
    template,
    warped_joints,
)
from clothsim.mesh.topology import unique_edges

STOUT = {"height": 1.6, "chest": 1.3, "waist": 1.5, "hips": 1.3, "shoulder_width": 1.1, "limb_girth": 1.2}


def volume(positions, triangles):
    a, b, c = (positions[triangles[:, k]] for k in range(3))
    return (a * np.cross(b, c)).sum() / 6


def smallest_angles(positions, triangles):
    corners = positions[triangles]
    angles = []
    for k in range(3):
        one, two = corners[:, (k + 1) % 3] - corners[:, k], corners[:, (k + 2) % 3] - corners[:, k]
        angles.append(np.arctan2(np.linalg.norm(np.cross(one, two), axis=1), (one * two).sum(axis=1)))
    return np.degrees(np.min(angles, axis=0))


def girth(positions, triangles, z, reach=0.21):
    """The length of the section at height z, without the arms (|x| < reach)."""
    corners = positions[triangles]
    above = corners[:, :, 2] > z
    cut = (above.any(axis=1) & ~above.all(axis=1)) & (np.abs(corners[:, :, 0]).max(axis=1) < reach)
    total = 0.0
    for triangle in corners[cut]:
        ends = []
        for k in range(3):
            a, b = triangle[k], triangle[(k + 1) % 3]
            if (a[2] > z) != (b[2] > z):
                ends.append(a + (z - a[2]) / (b[2] - a[2]) * (b - a))
        total += np.linalg.norm(ends[0] - ends[1])
    return total


def level(name, height=1.7):
    return (LEVELS[name] - TEMPLATE_SOLE) * height / TEMPLATE_HEIGHT


def test_it_is_a_closed_surface_of_the_promised_size():
    positions, triangles = mannequin()
    assert 4000 <= len(positions) <= 6000
    assert examine("mannequin", positions, triangles).findings == ()
    assert len(positions) - len(unique_edges(triangles)) + len(triangles) == 2
    assert (np.unique(np.sort(triangles, axis=1), axis=0, return_counts=True)[1] == 1).all()
    assert 0.04 < volume(positions, triangles) < 0.07
    assert positions[:, 2].min() == 0
    assert positions[:, 2].max() == pytest.approx(1.7, abs=1e-4)


def test_its_triangles_are_no_slivers():
    positions, triangles = mannequin()
    angles = smallest_angles(positions, triangles)
    assert angles.min() > 20
    assert np.percentile(angles, 1) > 30
    edges = unique_edges(triangles)
    lengths = np.linalg.norm(positions[edges[:, 0]] - positions[edges[:, 1]], axis=1)
    assert lengths.max() < 0.045
    assert lengths.min() > 0.001


def test_left_is_the_mirror_image_of_right():
    positions, triangles = mannequin()
    order = np.lexsort(np.round(positions.T, 9))
    image = mirrored(positions)
    np.testing.assert_allclose(positions[order], image[np.lexsort(np.round(image.T, 9))], atol=1e-9)
    twin = np.empty(len(positions), np.int64)
    twin[order] = np.lexsort(np.round(image.T, 9))
    reflected = {tuple(np.roll(t, -np.argmin(t))) for t in twin[triangles][:, ::-1]}
    assert reflected == {tuple(np.roll(t, -np.argmin(t))) for t in triangles}


def test_it_faces_forward_and_holds_its_left_hand_at_plus_x():
    positions, _ = mannequin()
    toes = positions[positions[:, 2] < 0.03]
    assert toes[:, 1].min() < -0.13
    assert toes[:, 1].max() < 0.09
    assert warped_joints(Proportions())[joint("left_wrist"), 0] > 0.4


@pytest.mark.parametrize("pose", POSES)
def test_one_topology_for_every_figure_and_pose(pose):
    positions, triangles = mannequin(**STOUT, pose=pose)
    np.testing.assert_array_equal(triangles, mannequin()[1])
    assert examine("body", positions, triangles, "body").errors == ()
    assert positions[:, 2].min() == 0
    assert smallest_angles(positions, triangles).min() > 1
    positions[0] = 7.0  # a mannequin is the caller's own
    assert mannequin()[0].max() < 7


def test_height_alone_is_a_similarity():
    small, _ = mannequin(height=0.85)
    large, _ = mannequin(height=1.7)
    np.testing.assert_allclose(2 * small, large, atol=1e-12)


@pytest.mark.parametrize("measure", ["chest", "waist", "hips"])
@pytest.mark.parametrize("factor", [0.85, 1.25])
def test_girths_follow_their_factors(measure, factor):
    positions, triangles = mannequin()
    z = level(measure)
    before = girth(positions, triangles, z)
    after = girth(*mannequin(**{measure: factor}), z)
    assert after / before == pytest.approx(factor, rel=0.01)
    others = {"chest", "waist", "hips"} - {measure}
    changed = mannequin(**{measure: factor})
    for other in others:
        same = girth(*changed, level(other))
        assert same == pytest.approx(girth(positions, triangles, level(other)), rel=0.01)


def test_the_default_has_plausible_girths():
    chest, waist, hips = (girth(*mannequin(), level(name)) for name in ("chest", "waist", "hips"))
    assert 0.8 < chest < 1.0
    assert 0.62 < waist < 0.8
    assert 0.85 < hips < 1.05
    assert waist < min(chest, hips)


def test_limbs_and_shoulders_follow_their_factors():
    knee = (JOINT_POSITIONS[joint("left_knee"), 2] - TEMPLATE_SOLE) * 1.7 / TEMPLATE_HEIGHT
    ratio = girth(*mannequin(limb_girth=1.2), knee) / girth(*mannequin(), knee)
    assert ratio == pytest.approx(1.2, rel=0.01)
    wide = warped_joints(Proportions(shoulder_width=1.1))
    shoulders = wide[joint("left_shoulder")] - wide[joint("right_shoulder")]
    before = warped_joints(Proportions())
    assert shoulders[0] == pytest.approx(
        1.1 * (before[joint("left_shoulder")] - before[joint("right_shoulder")])[0], rel=1e-9
    )


def test_weights_are_a_partition_of_unity_and_local():
    made = template()
    assert made.weights.min() >= 0
    np.testing.assert_allclose(made.weights.sum(axis=1), 1, atol=1e-14)
    assert (made.weights.max(axis=0) == 1).sum() >= len(JOINTS) - 2
    far = made.positions[:, 0] > 0.35
    assert made.weights[far][:, [joint("chest"), joint("left_hip"), joint("right_shoulder")]].max() == 0


def test_weights_are_continuous():
    points = template().positions[::7]
    step = np.random.default_rng(0).normal(size=points.shape)
    step *= 1e-5 / np.linalg.norm(step, axis=1)[:, None]
    assert np.abs(skinning_weights(points + step) - skinning_weights(points)).max() < 3e-3


def test_a_turned_elbow_turns_the_hand_rigidly_and_nothing_else():
    rest, _ = mannequin()
    turned, _ = mannequin(joints_degrees={"left_elbow": [0, 0, 90]})
    weights = template().weights
    hand = weights[:, joint("left_wrist")] == 1
    pivot = warped_joints(Proportions())[joint("left_elbow")]
    offset = rest[hand] - pivot
    np.testing.assert_allclose(turned[hand] - pivot, offset[:, [1, 0, 2]] * (-1, 1, 1), atol=1e-9)
    others = weights[:, [joint("left_elbow"), joint("left_wrist")]].sum(axis=1) == 0
    np.testing.assert_allclose(turned[others], rest[others], atol=1e-12)


def test_the_t_pose_has_level_arms_and_symmetric_poses_are_symmetric():
    positions, _ = mannequin(pose="t")
    hands = template().weights[:, joint("left_wrist")] == 1
    shoulder = warped_joints(Proportions())[joint("left_shoulder"), 2]
    assert positions[hands, 2].mean() == pytest.approx(shoulder, abs=0.01)
    np.testing.assert_allclose(positions[:, 0].min(), -positions[:, 0].max(), atol=1e-9)


def test_the_skeleton_is_a_tree_with_mirrored_sides():
    assert PARENTS[0] == -1
    assert (PARENTS[1:] < np.arange(1, len(JOINTS))).all()
    for k, name in enumerate(JOINTS):
        np.testing.assert_array_equal(JOINT_POSITIONS[joint(other_side(name))], mirrored(JOINT_POSITIONS[k]))
        if k:
            assert JOINTS[PARENTS[joint(other_side(name))]] == other_side(JOINTS[PARENTS[k]])


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"height": -1}, ["height", "0"]),
        ({"height": 170}, ["height", "0.5", "2.5", "170"]),
        ({"chest": 0.92e-3}, ["chest", "0.8", "1.35"]),
        ({"waist": "thin"}, ["waist", "thin"]),
        ({"hips": float("nan")}, ["hips", "nan"]),
        ({"limb_girth": 3}, ["limb_girth", "1.2"]),
        ({"pose": "run"}, ["pose", "walk", "run"]),
        ({"pose": ["a"]}, ["pose", "walk"]),
        ({"joints_degrees": 3}, ["joints_degrees", "3"]),
        ({"joints_degrees": {"left_elbo": [0, 0, 1]}}, ["joints_degrees", "left_elbo", "left_elbow"]),
        ({"joints_degrees": {"left_elbow": 30}}, ["joints_degrees.left_elbow", "3"]),
        ({"joints_degrees": {"left_elbow": [0, float("inf"), 0]}}, ["joints_degrees.left_elbow[1]", "inf"]),
    ],
)
def test_a_bad_key_is_named(keys, words):
    with pytest.raises(InputError) as caught:
        mannequin(**keys)
    assert caught.value.sentence.split()[0].removeprefix("mannequin.") == words[0]
    assert [word for word in words if word not in str(caught.value)] == []
