"""Canonical garments: the template is the posed body, and a posed garment comes back."""

import numpy as np
import pytest
from scipy.sparse import eye_array

from clothsim.files.characters.known_bodies import mannequin_character
from clothsim.mesh.generators.garments.shirt_skirt_trousers import shirt
from transfer.body_model import BodyModel
from transfer.canonical import PosedBody, posed_body, unposed_in_field
from transfer.diffuse import closest_average, kernel_average, sampled_average
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
