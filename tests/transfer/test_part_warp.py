"""Parts of a body, size factors of a larger one, and a garment with prescribed lengths."""

import numpy as np
import pytest

from clothsim.mesh.generators.table import GENERATORS
from transfer.body_parts import body_parts
from transfer.correspond import correspond
from transfer.garment import nearest_orthonormal, prescribed_shapes, with_lengths
from transfer.part_warp import graded_metric, size_factors
from transfer.signed_distance import body_surface

LARGE = {"height": 1.82, "chest": 1.15, "waist": 1.2, "hips": 1.12}
SMALL_BODY, LARGE_BODY = GENERATORS["mannequin"](), GENERATORS["mannequin"](**LARGE)
SHIRT = GENERATORS["shirt"]()


@pytest.fixture(scope="module")
def parts():
    return body_parts(*SMALL_BODY), body_parts(*LARGE_BODY)


def test_landmarks_are_where_a_person_has_them(parts):
    marks = parts[0].landmarks
    assert 0.40 < marks["crotch"] / marks["crown"] < 0.5
    assert 0.70 < marks["armpit"] / marks["crown"] < 0.8
    assert 0.84 < marks["neck"] / marks["crown"] < 0.9
    np.testing.assert_allclose(parts[0].tips[0] * [-1, 1, 1], parts[0].tips[1], atol=0.02)


def test_a_body_has_the_size_of_itself(parts):
    factors = size_factors(parts[0], parts[0])
    np.testing.assert_allclose(list(factors.named.values()), 1.0, atol=1e-12)


def test_factors_are_those_of_the_keys_of_the_figure(parts):
    named = size_factors(*parts).named
    tall = 1.82 / 1.70
    assert named["height"] == pytest.approx(tall, rel=0.01)
    assert named["leg_length"] == pytest.approx(tall, rel=0.01)
    assert named["trunk_length"] == pytest.approx(tall, rel=0.02)
    assert named["chest"] == pytest.approx(1.15 * tall, rel=0.04)
    assert named["waist"] == pytest.approx(1.2 * tall, rel=0.05)


def test_a_sleeve_and_a_hem_are_graded_along_their_own_axes(parts):
    factors = size_factors(*parts)
    hem = SHIRT[0][[SHIRT[0][:, 2].argmin()]]
    metric = graded_metric(factors, parts[0], SMALL_BODY[0], hem)[0]
    assert metric[2, 2] == pytest.approx(factors.lengths[0] ** 2, rel=0.05)
    assert metric[0, 0] == pytest.approx(metric[1, 1])
    assert np.linalg.eigvalsh(metric).min() > 0


def test_prescribed_shapes_have_the_lengths_of_the_metric():
    metric = np.diag([4.0, 1.0, 1.0])[None]
    shape = prescribed_shapes(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.0]]), np.array([[0, 1, 2]]), metric)[0]
    np.testing.assert_allclose(shape.T @ shape, [[4, 0], [0, 1]], atol=1e-12)


def test_nearest_orthonormal_matrices_are_those_of_the_svd():
    F = np.random.default_rng(0).normal(size=(20, 3, 2))
    left, _, right = np.linalg.svd(F, full_matrices=False)
    np.testing.assert_allclose(nearest_orthonormal(F), left @ right, atol=1e-8)


def test_a_stretched_garment_gets_its_own_lengths_back():
    far = body_surface(SMALL_BODY[0] + [0, 9.0, 0], SMALL_BODY[1])
    own = np.broadcast_to(np.eye(3), (len(SHIRT[1]), 3, 3))
    stretched = SHIRT[0] + 0.04 * np.sin(25 * SHIRT[0])
    shape = with_lengths(stretched, SHIRT[1], SHIRT[0], own, far, 1.7)
    edges = SHIRT[1][:, :2]
    before, wild, after = (
        np.linalg.norm(x[edges[:, 0]] - x[edges[:, 1]], axis=1) for x in (SHIRT[0], stretched, shape)
    )
    assert np.abs(wild / before - 1).max() > 0.7
    assert np.percentile(np.abs(after / before - 1), 99) < 0.1


@pytest.mark.parametrize("degrees", [0, 90, 180])
def test_a_turned_body_of_another_topology_is_met(degrees):
    middles = LARGE_BODY[0][LARGE_BODY[1]].mean(axis=1)  # another topology: each triangle cut in three
    own, new = LARGE_BODY[1], len(LARGE_BODY[0]) + np.arange(len(middles))
    thirds = np.concatenate([np.column_stack([own[:, k], own[:, (k + 1) % 3], new]) for k in range(3)])
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    found = correspond(*SMALL_BODY, np.concatenate([LARGE_BODY[0], middles]) @ turn.T, thirds)
    wanted = LARGE_BODY[0] @ turn.T
    error = np.linalg.norm(found.positions - wanted, axis=1)
    trunk = (SMALL_BODY[0][:, 2] > 0.8) & (SMALL_BODY[0][:, 2] < 1.4) & (np.abs(SMALL_BODY[0][:, 0]) < 0.15)
    assert np.percentile(error[trunk], 95) < 0.03
