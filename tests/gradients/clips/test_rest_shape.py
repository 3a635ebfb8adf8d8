"""Residual rest shapes: recovered where cloth follows its rest shape, smooth, bounded and priced."""

import numpy as np
import pytest

from clothsim.gradients.clips.rest_shape import LONGEST, RestMesh, _mixed, fitted_rest
from clothsim.mesh.body import rotation_matrix
from clothsim.mesh.generators.shapes import rectangle

TURN = rotation_matrix(np.array([0.4, -0.9, 0.3]))


def sheet():
    points, triangles = rectangle(size=(1.0, 1.0), cells=(8, 8))
    return RestMesh(points, triangles)


def bump(points, height=0.05):
    return np.array([0.0, 0.0, height]) * np.exp(-((points[:, :2] / 0.3) ** 2).sum(axis=1))[:, None]


def test_offsets_are_turned_back_by_the_rotation_of_the_cloth():
    own = sheet()
    offsets = np.random.default_rng(0).normal(size=own.rest.shape)
    np.testing.assert_allclose(own.turned_back(own.rest @ TURN.T, offsets @ TURN.T), offsets, atol=1e-12)


def test_cloth_that_follows_its_rest_shape_by_half_comes_to_the_key():
    own = sheet()
    wanted = own.smooth(bump(own.rest))

    def run(displacements):
        return [(own.rest + 0.5 * displacements) @ TURN.T + 0.2]

    key = (own.rest + 0.5 * wanted) @ TURN.T + 0.2
    moved, price = fitted_rest(own, [key], run(np.zeros_like(own.rest))[0], run, np.array([1e-6]))
    assert price.before == pytest.approx(0.5 * np.sqrt((wanted**2).sum(axis=1).mean()))
    assert price.after < 0.05 * price.before
    np.testing.assert_allclose(moved, wanted, atol=0.1 * wanted.max())
    assert price.displacement == pytest.approx(np.sqrt(((moved - moved.mean(axis=0)) ** 2).sum(axis=1).mean()))
    assert 0 < price.angle < np.pi / 4
    assert 0 < price.length <= LONGEST


def test_the_price_of_a_stretch_is_its_strain():
    own = sheet()
    price = own.price(0.07 * own.rest, 1.0, 0.5, 3)
    assert price.length == pytest.approx(0.07, rel=1e-12)
    assert price.angle == pytest.approx(0.0, abs=1e-9)
    away = 0.07 * np.linalg.norm(own.rest - own.rest.mean(axis=0), axis=1)
    assert price.most == pytest.approx(away.max(), rel=1e-12)


def test_two_steps_along_a_line_end_where_the_third_one_would_have_to():
    """Steps of 0.4 of the way that is left: Anderson's mixing is the secant method there, which is exact."""
    wanted = np.random.default_rng(0).normal(size=(5, 3))
    tried = [(at, 0.4 * (wanted - at)) for at in (np.zeros((5, 3)), 0.4 * wanted)]
    np.testing.assert_allclose(_mixed(tried), wanted, rtol=1e-12)


def test_nothing_is_added_where_runs_get_no_nearer():
    own = sheet()
    moved, price = fitted_rest(own, [own.rest + bump(own.rest)], own.rest, lambda d: [own.rest - d], np.array([1e-6]))
    assert not moved.any()
    assert price.after == price.before
    failing = fitted_rest(own, [own.rest + bump(own.rest)], own.rest, lambda d: [], np.array([1e-6]))[0]
    assert not failing.any()


def test_smoothing_leaves_translations_and_lowers_what_is_rough():
    own = sheet()
    np.testing.assert_allclose(own.smooth(np.ones_like(own.rest)), 1.0)
    spike = np.zeros_like(own.rest)
    spike[40] = 1.0
    assert own.smooth(spike).max() < 0.6


def test_edges_are_bounded():
    own = sheet()
    rough = 0.2 * np.random.default_rng(0).normal(size=own.rest.shape)
    assert own.price(rough, 1.0, 1.0, 0).length > LONGEST
    assert own.price(own.bounded(rough), 1.0, 1.0, 0).length <= LONGEST + 1e-9


def test_a_key_that_is_hardly_known_draws_little():
    own = sheet()
    near, far = own.rest + own.smooth(bump(own.rest)), own.rest - own.smooth(bump(own.rest))

    def run(displacements):
        return [own.rest + displacements] * 2

    start = np.concatenate(run(np.zeros_like(own.rest)))
    moved, price = fitted_rest(own, [near, far], start, run, np.array([1e-4, 1.0]))
    np.testing.assert_allclose(own.rest + moved, near, atol=3e-3)
    assert price.after < 0.1 * price.before
