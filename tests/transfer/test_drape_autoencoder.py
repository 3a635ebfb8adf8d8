"""Auto-encoder of drapes: evaluation against a linear one, its arrays, and training where JAX is installed.

Signed distance on a grid against that of a sphere.
"""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from transfer.drape_autoencoder import DrapeAutoencoder, distance_grid, drape_autoencoder
from transfer.errors import TransferError
from transfer.networks import network
from transfer.signed_distance import body_surface
from transfer.subspace import metric_components, ridge

PARAMETERS = np.random.default_rng(3).uniform(-1, 1, (40, 2))


def ball(subdivisions=3):
    """A unit sphere."""
    import trimesh

    made = trimesh.creation.icosphere(subdivisions)
    return body_surface(made.vertices, made.faces)


def patches():
    """Patches of 25 points around the top of the unit sphere, lifted and, the more, tilted by two parameters."""
    x, y = (0.6 * each.ravel() for each in np.meshgrid(np.linspace(-1, 1, 5), np.linspace(-1, 1, 5)))
    lifts = 0.06 * (1 + PARAMETERS[:, 0])
    heights = [np.sqrt(1 - x**2 - y**2) + lift * (1 + b * x) for lift, b in zip(lifts, PARAMETERS[:, 1], strict=True)]
    return np.array([np.column_stack([x, y, each]).ravel() for each in heights])


def linear(drapes):
    """An auto-encoder of one layer each, which is that of principal components and ridge regression."""
    space = metric_components(drapes, 2)
    codes = space.coefficients(drapes)
    fit = ridge(PARAMETERS, codes, 0.0)
    eye, none = np.eye(2), np.zeros(2)
    return DrapeAutoencoder(
        space, 2.0, fit.centre, fit.scale, fit.low, fit.high,
        ((np.hstack([eye, 0 * eye]), np.zeros(4)),), ((eye, none),), ((fit.weights[1:] / 2, fit.weights[0] / 2),),
    )  # fmt: skip


def test_a_network_is_layers_with_tanh_between():
    first, second = (np.array([[2.0]]), np.array([1.0])), (np.array([[3.0]]), np.array([-1.0]))
    assert network([first, second], np.array([[0.5]])) == pytest.approx(3 * np.tanh(2.0) - 1)


def test_linear_layers_are_principal_components_and_ridge():
    drapes = patches()
    made = linear(drapes)
    assert made.code_size == 2
    assert np.allclose(made.drapes(made.codes(drapes)), drapes, atol=1e-12)  # two modes, lift and tilt
    fit = ridge(PARAMETERS, made.space.coefficients(drapes), 0.0)
    assert np.allclose(made.predicted(PARAMETERS), made.space.drapes(fit(PARAMETERS)), atol=1e-12)
    assert np.array_equal(made.predicted([[9.0, -9.0]]), made.predicted([[made.high[0], made.low[1]]]))


def test_it_is_read_as_it_was_written(tmp_path):
    made = linear(patches())
    np.savez(tmp_path / "model.npz", **made.arrays())
    with np.load(tmp_path / "model.npz") as arrays:
        again = drape_autoencoder(arrays)
    assert np.array_equal(again.predicted(PARAMETERS), made.predicted(PARAMETERS))


@pytest.mark.parametrize("fault", ["missing", "size"])
def test_broken_arrays_are_refused(fault):
    arrays = linear(patches()).arrays()
    if fault == "missing":
        del arrays["decoder.0.weights"]
    if fault == "size":
        arrays |= {"regressor.0.weights": np.zeros((2, 3)), "regressor.0.biases": np.zeros(3)}
    with pytest.raises(TransferError):
        drape_autoencoder(arrays)


def test_a_training_keeps_drapes_of_random_codes_out_of_the_body():
    pytest.importorskip("jax")
    from transfer.drape_autoencoder import Training, trained_autoencoder

    drapes, body = patches(), ball(2)
    grid = distance_grid(body, drapes.reshape(-1, 3), 0.05, 0.2)
    space = metric_components(drapes, 2)
    given = Training(
        code_size=2,
        hidden=(16,),
        regressor=(16,),
        steps=300,
        regressor_steps=300,
        rate=0.01,
        collision=1.0,
        clearance=0.02,
    )
    codes = np.random.default_rng(0).standard_normal((300, 2))
    inside = {}
    for count in (0, 32):
        made = trained_autoencoder(space, drapes, PARAMETERS, grid, replace(given, random_codes=count))
        spread = np.sqrt(((drapes - drapes.mean(axis=0)) ** 2).sum(axis=1).mean())
        miss = made.predicted(PARAMETERS) - drapes
        assert np.sqrt((miss**2).sum(axis=1).mean()) < 0.3 * spread
        inside[count] = body.closest(made.drapes(codes).reshape(-1, 3)).inside.mean()
    assert inside[32] <= 0.5 * inside[0]


SPHERE = trimesh.creation.icosphere(4)
BODY = body_surface(SPHERE.vertices, SPHERE.faces)


def test_nodes_are_exact_and_between_them_the_error_falls_as_the_square_of_the_spacing():
    points = np.random.default_rng(0).uniform([-0.4, -0.4, 0.5], [0.4, 0.4, 1.3], (200, 3))
    exact = BODY.closest(points).signed_distance
    errors = []
    for spacing in (0.1, 0.05):
        grid = distance_grid(BODY, points, spacing)
        node = grid.origin + spacing * np.array([3, 2, 1])
        assert grid.signed_distance([node])[0] == pytest.approx(BODY.closest([node]).signed_distance[0], abs=1e-12)
        errors.append(np.sqrt(np.mean((grid.signed_distance(points) - exact) ** 2)))
    assert errors[0] < 2e-3
    assert errors[1] < 0.4 * errors[0]


def test_outside_of_the_grid_the_boundary_counts():
    grid = distance_grid(BODY, [[0, 0, 1.0]], 0.05, 0.09)
    end = grid.origin[2] + 0.05 * (grid.values.shape[2] - 1)
    assert grid.signed_distance([[0, 0, 9.0]])[0] == pytest.approx(grid.signed_distance([[0, 0, end]])[0])
    assert end >= 1.09


@pytest.mark.parametrize(("spacing", "margin"), [(0.0, 0.1), (1e-4, 0.1), (0.1, -1.0)])
def test_bad_sizes_are_refused(spacing, margin):
    with pytest.raises(TransferError):
        distance_grid(BODY, [[0, 0, 1.0]], spacing, margin)
