"""Residual rest shapes: recovered where cloth follows its rest shape, smooth, bounded and priced."""

import numpy as np
import pytest

from clothsim.gradients.clips.rest_shape import (
    LONGEST,
    RestMesh,
    _mixed,
    fitted_lengths,
    fitted_rest,
    is_stretch,
    length_changes,
)
from clothsim.mesh.body import rotation_matrix
from clothsim.mesh.generators.shapes import rectangle
from clothsim.mesh.topology import unique_edges

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


def test_lengths_are_found_and_a_bent_sheet_is_not_stretched():
    """A sheet bent about a cylinder, its lower end 4 % wider: each length is found to a thousandth."""
    points, triangles = rectangle(size=(0.3, 0.3), cells=(6, 6))
    sheet = RestMesh(points + [0, 0, 0.01] * np.sin(9 * points[:, [0]]), triangles)
    edges = unique_edges(triangles)
    wider = sheet.rest * [1, 1, 1] * (1 + 0.04 * np.clip(-points[:, [1]] / 0.15, 0, 1) * [1, 0, 0])
    wanted = np.log(edge_lengths(wider, edges) / edge_lengths(sheet.rest, edges))
    moved = sheet.lengthened(np.zeros_like(points), wanted)
    got = np.log(edge_lengths(sheet.rest + moved, edges) / edge_lengths(sheet.rest, edges))
    np.testing.assert_allclose(got, wanted, atol=2e-3)
    assert np.abs(wanted).max() > 0.03


def edge_lengths(points, edges):
    return np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1)


def test_lengths_that_both_keys_have_bring_the_cloth_to_them():
    """Cloth that takes its rest lengths, folded another way in each key."""
    points, triangles = rectangle(size=(0.3, 0.3), cells=(6, 6))
    sheet = RestMesh(points, triangles)
    longer = points * [1, 1.05, 1]

    def folded(flat, height):
        return flat + height * np.sin(20 * flat[:, [0]]) * [0, 0, 1]

    keys = [folded(longer, 0.004), folded(longer, -0.002)]
    start = np.concatenate([folded(points, 0.004), folded(points, -0.002)])
    moved, positions, runs = fitted_lengths(
        sheet, keys, start, lambda d: [folded(points + d, h) for h in (0.004, -0.002)], np.full(2, 1e-4), 1e-3
    )
    assert 1 <= runs <= 3
    np.testing.assert_allclose(np.ptp(points[:, 1] + moved[:, 1]), 1.05 * 0.3, rtol=2e-3)
    assert np.abs(positions - np.concatenate(keys)).max() < 1e-3


def test_another_stiffness_is_no_other_length():
    points, triangles = rectangle(size=(0.3, 0.3), cells=(4, 4))
    sheet, hanging = RestMesh(points, triangles), points * [1, 1.02, 1]
    stiffer, longer = points * [1, 1.005, 1], hanging * [1.03, 1, 1]
    assert is_stretch(sheet, hanging, [stiffer])
    assert not is_stretch(sheet, hanging, [longer])


def test_an_edge_without_length_in_a_key_changes_by_a_bound():
    points, triangles = rectangle(size=(0.3, 0.3), cells=(2, 2))
    edges, key = unique_edges(triangles), points.copy()
    key[edges[0, 0]] = key[edges[0, 1]]
    changes = length_changes(edges, points, [key])
    assert changes[0] == np.log(1 - 2 * LONGEST)
    assert np.isfinite(changes).all()
