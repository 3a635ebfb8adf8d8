"""Smooth union against spheres, finite differences and its own lattice form."""

import numpy as np
import pytest

from clothsim.mesh.generators.garments.body_limbs import SMOOTHING, body_limbs
from clothsim.mesh.generators.garments.implicit import limb, smooth_union
from tests.benchmarks.make_mannequin import body_field, body_lattice

X, Y = np.eye(3)[:2]


def random_points(n=400, seed=0):
    return np.random.default_rng(seed).uniform((-0.7, -0.2, 0.0), (0.7, 0.2, 1.7), (n, 3))


def test_a_round_limb_has_the_distance_of_a_capsule():
    one = limb((0, 0, 0), (0, 0.6, 0), X, [(0, 0.1, 0.1), (1, 0.1, 0.1)], (0.1, 0.1))
    points = random_points() * (1, 3, 0.3)
    nearest = np.clip(points[:, 1], 0, 0.6)[:, None] * Y
    np.testing.assert_allclose(one.distance(points)[0], np.linalg.norm(points - nearest, axis=1) - 0.1, atol=1e-12)


def test_the_radii_go_through_the_knots():
    one = limb((0, 0, 0), (0, 0, 1), X, [(0, 0.1, 0.2), (0.3, 0.15, 0.1), (1, 0.05, 0.07)], (0.1, 0.1))
    points = np.array([[0.1, 0, 0], [0.15, 0, 0.3], [0.05, 0, 1], [0, 0.2, 0], [0, 0.1, 0.3], [0, 0.07, 1]])
    np.testing.assert_allclose(one.distance(points)[0], 0, atol=1e-15)


def test_two_equal_spheres_blend_by_log_two():
    ball = limb((0, 0, 0), (0, 0, 0), X, [(0, 0.1, 0.1)], (0.1,) * 2)
    value, _ = smooth_union([ball, ball], np.array([[0.13, 0, 0]]), 0.01)
    np.testing.assert_allclose(value, 0.03 - 0.01 * np.log(2), rtol=1e-9)


def test_the_gradient_of_the_body_is_the_difference_quotient():
    points = random_points()
    step = 1e-6
    value, gradient = body_field(points)
    near = np.abs(value) < 0.1
    assert near.sum() > 50
    for k in range(3):
        move = step * np.eye(3)[k]
        quotient = (body_field(points + move)[0] - body_field(points - move)[0]) / (2 * step)
        np.testing.assert_allclose(gradient[near, k], quotient[near], atol=2e-4)


def test_the_lattice_has_the_same_values_near_the_surface():
    nodes = (np.linspace(-0.01, 0.7, 30), np.linspace(-0.2, 0.2, 18), np.linspace(0, 1.7, 60))
    values = body_lattice(nodes)
    points = np.stack(np.meshgrid(*nodes, indexing="ij"), axis=3).reshape(-1, 3)
    whole = body_field(points)[0].reshape(values.shape)
    near = np.abs(whole) < 0.03
    np.testing.assert_allclose(values[near], whole[near], atol=2e-3)
    assert ((values < 0) == (whole < 0))[np.abs(whole) > 2e-3].all()


def test_the_union_is_no_smaller_than_any_limb():
    points = random_points(seed=1)
    value, _ = smooth_union([one.limb for one in body_limbs()], points, SMOOTHING)
    nearest = np.min([one.limb.distance(points)[0] for one in body_limbs()], axis=0)
    assert (value <= nearest + 1e-12)[nearest < 0.2].all()
    assert value[nearest < 0.2] == pytest.approx(nearest[nearest < 0.2], abs=SMOOTHING * np.log(6))
