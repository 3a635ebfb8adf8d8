"""Linear models of drapes against closed forms and generalised eigenproblems."""

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.sparse import csr_array

from transfer.errors import TransferError
from transfer.subspace import metric_components, nearest, ridge


def data(n=20, m=12):
    random = np.random.default_rng(0)
    root = random.normal(size=(m, m))
    return random.normal(size=(n, m)) * np.linspace(3, 0.1, m), root @ root.T + np.eye(m)


@pytest.mark.parametrize("sparse", [False, True])
def test_components_solve_the_generalised_eigenproblem(sparse):
    drapes, G = data()
    made = metric_components(drapes, 5, csr_array(G) if sparse else G)
    covariance = np.cov(drapes.T)
    # G C G b = s G b, b'Gb = 1
    values = eigh(G @ covariance @ G, G, eigvals_only=True)[::-1][:5]
    assert np.allclose(made.variances, values, rtol=1e-10)
    assert np.allclose(made.basis.T @ G @ made.basis, np.eye(5), atol=1e-10)
    assert np.allclose(G @ covariance @ G @ made.basis, G @ made.basis * values, atol=1e-8)


def test_the_projection_is_the_best_in_the_metric():
    drapes, G = data()
    made = metric_components(drapes, 4, G)
    codes = made.coefficients(drapes)
    error = drapes - made.drapes(codes)
    assert np.allclose(error @ G @ made.basis, 0, atol=1e-9)
    lost = np.einsum("ni,ij,nj->", error, G, error) / (len(drapes) - 1)
    everything = metric_components(drapes, 19, G).variances
    assert np.isclose(lost, everything[4:].sum(), rtol=1e-9)


def test_all_components_reproduce_and_the_rank_bounds_their_number():
    drapes, _ = data(n=5)
    made = metric_components(drapes, 12)
    assert made.basis.shape == (12, 4)
    assert np.allclose(made.drapes(made.coefficients(drapes)), drapes, atol=1e-12)


def test_ridge_finds_a_linear_map_and_clips_to_its_box():
    random = np.random.default_rng(1)
    x = random.uniform([0, 10], [1, 30], (50, 2))
    y = x @ [[1.0, 2.0], [0.5, -1.0]] + 3
    fit = ridge(x, y, 1e-12)
    assert np.allclose(fit(x), y, atol=1e-8)
    assert np.allclose(fit([[5.0, 20.0]]), fit([[x[:, 0].max(), 20.0]]))
    heavy = ridge(x, y, 1e9)
    assert np.allclose(heavy(x), y.mean(axis=0), atol=1e-6)


def test_ridge_is_the_minimum_of_its_objective():
    random = np.random.default_rng(2)
    x, y = random.normal(size=(30, 3)), random.normal(size=(30, 2))
    fit = ridge(x, y, 0.1)
    z = np.column_stack([np.ones(30), (x - x.mean(0)) / x.std(0)])

    def objective(w):
        return ((z @ w - y) ** 2).sum() + 0.1 * 30 * (w[1:] ** 2).sum()

    best = objective(fit.weights)
    assert all(objective(fit.weights + 1e-3 * random.normal(size=(4, 2))) > best for _ in range(5))


def test_nearest_neighbours():
    x, y = np.array([[0.0], [1.0], [4.0]]), np.array([[0.0], [10.0], [40.0]])
    assert np.allclose(nearest(x, y, x), y)
    assert np.allclose(nearest(x, y, [[0.25]], 2), 2.5)


def test_bad_arrays_are_refused():
    with pytest.raises(TransferError):
        metric_components([1.0, 2.0], 1)
    with pytest.raises(TransferError):
        ridge([[1.0]], [[1.0], [2.0]])
