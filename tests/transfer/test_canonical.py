"""Canonical garments: the template is the posed body, and a posed garment comes back.

Diffused body model: rows of averages, their continuity between limbs, and the body's own template.
"""

import numpy as np
import pytest
from scipy.sparse import eye_array

from clothsim.files.characters.character import mannequin_character
from clothsim.mesh.generators.garments import shirt
from transfer.body_model import BodyModel, PosedBody, posed_body
from transfer.canonical import closest_average, kernel_average, sampled_average, unposed_in_field
from transfer.errors import TransferError


@pytest.fixture(scope="module")
def model():
    """The mannequin as a body model, with made-up blend shapes."""
    character = mannequin_character()
    rng, n, j = np.random.default_rng(3), len(character.positions), len(character.skeleton.names)
    joints = character.skeleton.rest_positions()
    homogeneous = np.column_stack([character.positions, np.ones(n)])
    regressor = np.column_stack([joints, np.ones(j)]) @ np.linalg.pinv(homogeneous)  # rows of sum 1
    smooth = character.weights @ rng.normal(0, 1e-3, (j, 3 * 9 * (j - 1)))
    shapes = character.weights @ rng.normal(0, 0.01, (j, 3 * 2))
    return BodyModel(
        character.positions,
        character.triangles,
        shapes.reshape(n, 3, 2),
        smooth.reshape(n, 3, -1),
        regressor,
        character.weights,
        character.skeleton.parents,
    )


@pytest.fixture(scope="module")
def garment():
    return shirt(edge=0.04, ease=0.02)[0]


def pose(model, seed, angle=0.25):
    rng = np.random.default_rng(seed)
    theta = rng.normal(0, angle, (len(model.parents), 3))
    return rng.normal(0, 1, 2), theta


@pytest.mark.parametrize("make", [closest_average, sampled_average])
def test_the_template_becomes_the_posed_body(model, make):
    beta, theta = pose(model, 0)
    rows = make(model.template, model.triangles).averaging(model.template)
    found = posed_body(model, beta, theta).posed(model.template, rows)
    np.testing.assert_allclose(found, model.vertices(beta, theta), rtol=0, atol=1e-12)


def test_the_kernel_misses_the_body_by_millimetres(model):
    beta, theta = pose(model, 0)
    rows = kernel_average(model.template, model.triangles).averaging(model.template)
    found = posed_body(model, beta, theta).posed(model.template, rows)
    off = np.linalg.norm(found - model.vertices(beta, theta), axis=1)
    assert 1e-6 < np.median(off) < 1e-4
    assert off.max() < 0.01


def test_fixed_rows_are_inverted(model, garment):
    rows = kernel_average(model.template, model.triangles).averaging(garment)
    for seed in range(20):
        body = posed_body(model, *pose(model, seed))
        shape = garment + np.random.default_rng(seed).normal(0, 0.01, garment.shape)
        np.testing.assert_allclose(body.unposed(body.posed(shape, rows), rows), shape, rtol=0, atol=1e-9)


def test_the_field_reproduces_the_garment(model, garment):
    average = kernel_average(model.template, model.triangles)
    rows = average.averaging(garment)
    body = posed_body(model, *pose(model, 5))
    given = body.posed(garment + np.random.default_rng(5).normal(0, 0.004, garment.shape), rows)
    found = unposed_in_field(body, given, average.averaging, body.unposed(given, rows))
    again = body.posed(found.positions, average.averaging(found.positions))
    np.testing.assert_allclose(np.linalg.norm(again - given, axis=1), found.residuals, rtol=0, atol=1e-12)
    assert np.mean(found.residuals <= 1e-3) >= 0.99


def test_a_singular_blend_is_named():
    half = PosedBody(
        np.full((1, 2), 0.5), np.zeros((1, 3)), np.array([np.eye(3), np.diag([-1, -1, 1.0])]), np.eye(2, 3)
    )
    with pytest.raises(TransferError):
        half.unposed([[0, 0, 0]], eye_array(1, format="csr"))


def test_rows_of_another_garment_are_refused(model):
    with pytest.raises(TransferError):
        posed_body(model).posed([[0, 0, 0]], eye_array(1, format="csr"))


SPACING = 1e-4
MADE = {"closest": closest_average, "sampled": sampled_average, "kernel": kernel_average}


@pytest.fixture(scope="module")
def body():
    return mannequin_character()


@pytest.fixture(scope="module")
def lines(body):
    """Middles and directions of 20 random lines across the gap of the legs and the armpits."""
    rng = np.random.default_rng(24)
    legs = (np.abs(body.positions[:, 0]) < 0.12) & (body.positions[:, 2] > 0.2) & (body.positions[:, 2] < 0.78)
    left = np.flatnonzero(legs & (body.positions[:, 0] > 0.01))
    starts = body.positions[rng.choice(left, 12)]
    found = [(s * (0, 1, 1), np.array([1.0, 0.1 * rng.normal(), 0.1 * rng.normal()])) for s in starts]
    for sign in (1, -1, 1, -1, 1, -1, 1, -1):  # the armpit: between the upper arm and the side of the chest
        middle = np.array([sign * rng.uniform(0.2, 0.24), rng.uniform(-0.02, 0.04), rng.uniform(1.18, 1.3)])
        found.append((middle, np.array([sign * 0.8, 0.1 * rng.normal(), 0.55])))
    return [(middle, d / np.linalg.norm(d)) for middle, d in found]


def jumps(body, average, lines, spacing):
    along = np.arange(-0.03, 0.03, spacing)
    largest = []
    for middle, direction in lines:
        weights = average.averaging(middle + along[:, None] * direction) @ body.weights
        largest.append(np.abs(np.diff(weights, axis=0)).max())
    return np.array(largest)


@pytest.mark.parametrize("name", MADE)
def test_rows_are_averages(body, name):
    points = body.positions[::40] + np.random.default_rng(1).normal(0, 0.05, body.positions[::40].shape)
    rows = MADE[name](body.positions, body.triangles).averaging(points)
    assert rows.shape == (len(points), len(body.positions))
    assert rows.data.min() >= 0
    np.testing.assert_allclose(rows.sum(axis=1), 1, rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", ["closest", "sampled"])
def test_exact_on_the_surface(body, name):
    corners = body.positions[body.triangles[::50]]
    points = np.concatenate([body.positions[::50], corners.mean(axis=1)])
    values = MADE[name](body.positions, body.triangles).averaging(points) @ body.positions
    np.testing.assert_allclose(values, points, rtol=0, atol=1e-12)


def test_the_kernel_is_continuous_between_limbs(body, lines):
    average = kernel_average(body.positions, body.triangles)
    coarse = jumps(body, average, lines, SPACING)
    assert coarse.max() <= 0.01
    steepest = [lines[k] for k in np.argsort(coarse)[-3:]]
    fine = jumps(body, average, steepest, 0.3 * SPACING)
    assert fine.max() <= 0.36 * coarse.max()


def test_a_sample_jumps_by_its_share(body, lines):
    average = sampled_average(body.positions, body.triangles, 64)
    smooth = 1e-3  # beside the jumps, each sample's weights vary along the surface
    assert jumps(body, average, lines[::4], SPACING).max() <= 2 / 64 + smooth


def test_the_closest_point_jumps(body, lines):
    assert jumps(body, closest_average(body.positions, body.triangles), lines, SPACING).max() > 0.9


def test_no_point_has_no_row(body):
    for make in MADE.values():
        assert make(body.positions, body.triangles).averaging(np.zeros((0, 3))).shape == (0, len(body.positions))


def test_faults_are_named(body):
    with pytest.raises(TransferError):
        kernel_average(body.positions, body.triangles).averaging([[0, 0, np.nan]])
    with pytest.raises(TransferError):
        sampled_average(body.positions, body.triangles, 0)
