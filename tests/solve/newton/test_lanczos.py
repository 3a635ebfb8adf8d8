"""Saddle-free Krylov solve: the solution of definite matrices, the mirrored step of indefinite ones."""

from functools import partial

import numpy as np
import pytest

from clothsim.solve.newton.lanczos import MAX_PRODUCTS, RELATIVE_ERROR, lowest_eigenvector, saddle_free_solve

TRUST = 3.0


def matrix(eigenvalues, seed=0):
    q, _ = np.linalg.qr(np.random.default_rng(seed).standard_normal((len(eigenvalues),) * 2))
    return (q * eigenvalues) @ q.T


def right(n, seed=1):
    return np.random.default_rng(seed).standard_normal(n)


def solved(times, precondition, b):
    return saddle_free_solve(times, precondition, b, TRUST, precondition(b))


def test_an_exact_preconditioner_gives_the_solution_at_once():
    A, b, calls = matrix(np.linspace(1, 50, 30)), right(30), []

    def times(v):
        calls.append(v)
        return A @ v

    x = solved(times, lambda r: np.linalg.solve(A, r), b).x
    assert np.abs(A @ x - b).max() < 1e-11
    assert len(calls) == 1


def test_the_error_is_below_its_bound_in_the_preconditioner_s_norm():
    A, b = matrix(np.linspace(1, 3, 30)), right(30)
    preconditioner = np.linalg.inv(matrix(np.linspace(1, 3, 30) + 0.5))
    residual = b - A @ solved(lambda v: A @ v, lambda r: preconditioner @ r, b)[0]
    assert residual @ preconditioner @ residual <= RELATIVE_ERROR**2 * (b @ preconditioner @ b)


@pytest.mark.parametrize("lowest", [-1e-3, -1.0, -50.0])
@pytest.mark.parametrize("seed", range(4))
def test_an_indefinite_matrix_still_gives_a_descent_direction(lowest, seed):
    A = matrix(np.concatenate([np.full(5, lowest), np.linspace(1, 9, 25)]), seed)
    b = right(30, seed)
    x = solved(lambda v: A @ v, lambda r: 0.3 * r, b).x
    assert x @ b > 0
    assert np.isfinite(x).all()


def test_negative_curvature_is_turned_round():
    """With all of the space, x = |A|^-1 b, though b asks for several directions that curve down."""
    values = np.array([-4.0, -2.0, -1.0, 1.0, 2.0, 3.0])
    A, b = matrix(values, seed=3), right(6)
    found = saddle_free_solve(lambda v: A @ v, lambda r: r, b, 1e6, b)
    assert found.x == pytest.approx(np.linalg.solve(matrix(np.abs(values), seed=3), b), rel=1e-6)
    assert found.negative_curvature
    assert found.products == 6


def test_a_preconditioner_that_mirrors_the_matrix_gives_its_own_direction_in_two_products():
    values = np.array([-4.0, -2.0, -1.0, 1.0, 2.0, 3.0])
    A, b, inverse = matrix(values, seed=3), right(6), np.linalg.inv(matrix(np.abs(values), seed=3))
    found = solved(lambda v: A @ v, lambda r: inverse @ r, b)
    assert found.x == pytest.approx(inverse @ b, rel=1e-10)
    assert found.products == 2


def test_iterations_are_bounded():
    A, calls = matrix(np.logspace(0, 12, 60)), []

    def times(v):
        calls.append(v)
        return A @ v

    assert solved(times, lambda r: r, right(60)).products == MAX_PRODUCTS
    assert len(calls) == MAX_PRODUCTS


def test_nothing_to_solve_is_nothing():
    assert not solved(lambda v: v, lambda r: r, np.zeros(4))[0].any()


def test_a_nearly_flat_valley_is_not_followed_to_its_far_end():
    b = np.array([1.0, 1.0])
    A = np.diag([1.0, 1e-4])
    x = solved(lambda v: A @ v, lambda r: r, b).x
    assert x @ b > 0
    assert np.linalg.norm(x) <= TRUST * np.linalg.norm(b)


def test_no_direction_is_longer_than_the_trust_in_it():
    """Along each eigenvector x is at most `trust` times what the preconditioner alone takes."""
    A, b = np.diag([1.0, 1e-4, -1e-3, -5.0]), right(4)
    x = solved(lambda v: A @ v, lambda r: r, b).x
    assert np.abs(x / b) == pytest.approx([1.0, TRUST, TRUST, 0.2], rel=RELATIVE_ERROR)


def test_a_product_that_is_not_finite_leaves_the_preconditioner_s_direction():
    A, b, calls = matrix(np.linspace(1, 50, 30)), right(30), []

    def times(v):
        calls.append(v)
        return A @ v if len(calls) < 3 else np.full(30, np.nan)

    found = solved(times, lambda r: 0.1 * r, b)
    assert found.x == pytest.approx(0.1 * b)
    assert found.products == 0


@pytest.mark.parametrize("values", [np.logspace(0, 12, 60), np.linspace(0.1, 1, 60)])
def test_no_back_solve_comes_after_the_last_product(values):
    """The first is given; one more would only tell how far the last vector couples to the next."""
    A, b, calls = matrix(values), right(60), []

    def precondition(r):
        calls.append(r)
        return r

    found = saddle_free_solve(lambda v: A @ v, precondition, b, TRUST, b, above=True)
    assert found.products > 2
    assert len(calls) == found.products - 1


def test_a_few_directions_that_the_preconditioner_lacks_are_not_left_out():
    """A factor kept from before contact has closed: the bound holds where the method ends before its last product."""
    ends = 0
    for seed in range(200):
        rng = np.random.default_rng(seed)
        values = np.concatenate([rng.uniform(0.3, 1.0, 58), 10 ** rng.uniform(1, 4, 2)])
        A, b = matrix(values, seed), right(60, seed)
        found = saddle_free_solve(partial(np.matmul, A), lambda r: r, b, 1e6, b)
        if found.products < MAX_PRODUCTS:
            ends += 1
            assert np.linalg.norm(b - A @ found.x) <= 1.001 * RELATIVE_ERROR * np.linalg.norm(b)
    assert ends > 20


def test_a_right_hand_side_whose_square_is_not_finite_leaves_the_preconditioner_s_direction():
    found = solved(lambda v: 2.0 * v, lambda r: 0.1 * r, np.full(30, 1e200))
    assert found.x == pytest.approx(np.full(30, 1e199))
    assert found.products == 0


# --- lowest eigenvector ---------------------------------------------------------------------------------------------


def inverse_of(metric):
    """r -> P^-1 r."""
    inverse = np.linalg.inv(metric)
    return lambda r: inverse @ r


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("lowest", [-1e-6, -0.3, -50.0])
def test_the_lowest_eigenvector_of_a_pencil(lowest, seed):
    """A v = t P v against LAPACK, with a cluster at 1 as a projected Hessian has; P' v is normalised."""
    rng = np.random.default_rng(seed)
    n = 60
    metric = matrix(10.0 ** rng.uniform(-4, 4, n), seed)
    wanted = np.concatenate([[lowest], np.linspace(0.2, 0.8, 9), np.ones(n - 10)])
    root = np.linalg.cholesky(metric)
    A = root @ matrix(wanted, seed + 10) @ root.T
    start = rng.standard_normal(n)
    value, v = lowest_eigenvector(lambda x: A @ x, inverse_of(metric), start)
    assert value == pytest.approx(lowest, rel=1e-4, abs=1e-9)
    assert v @ metric @ v == pytest.approx(1.0, rel=1e-6)
    assert start @ v >= 0.0
    assert v @ A @ v == pytest.approx(lowest, rel=1e-4, abs=1e-9)


def test_an_eigenvector_keeps_the_symmetry_of_its_start():
    """Where A and P do not couple two halves, a start in one half never sees the other."""
    A = np.diag([-5.0, 1.0, -2.0, 1.0])
    value, v = lowest_eigenvector(lambda x: A @ x, lambda r: r.copy(), np.array([0.0, 0.0, 1.0, 1.0]))
    assert value == pytest.approx(-2.0)
    assert v == pytest.approx([0.0, 0.0, 1.0, 0.0], abs=1e-12)


@pytest.mark.parametrize(("A", "start"), [(np.zeros((3, 3)), np.ones(3)), (np.eye(3), np.zeros(3))])
def test_a_pencil_without_anything_has_no_negative_eigenvalue(A, start):
    value, v = lowest_eigenvector(lambda x: A @ x, lambda r: r.copy(), start)
    assert not value < 0.0
    assert np.isfinite(v).all()


def test_an_eigenvector_that_is_not_finite_is_none():
    value, v = lowest_eigenvector(lambda x: np.full(3, np.nan), lambda r: r.copy(), np.ones(3))
    assert np.isnan(value)
    assert not v.any()
