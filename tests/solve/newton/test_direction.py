"""Newton direction: no net force is left of an inexact solve."""

import numpy as np
import pytest

from clothsim.solve.newton.direction import MAX_RADIUS, MIN_RADIUS, PROJECTED, Trust, _is_positive, without_net_force


def chain(masses, stiffness):
    """Symmetric matrix of masses (n,) in a row, with springs between neighbours, in three dimensions."""
    n = len(masses)
    ends = np.diff(np.eye(n), axis=0)
    return np.kron(np.diag(masses) + stiffness * ends.T @ ends, np.eye(3))


def translated(matrix):
    """Products with the translations along x, y and z, (3, 3 n)."""
    return np.array([matrix @ np.tile(axis, len(matrix) // 3) for axis in np.eye(3)])


@pytest.mark.parametrize("seed", range(3))
def test_no_net_force_is_left_and_the_model_falls(seed):
    random = np.random.default_rng(seed)
    matrix = chain(random.uniform(0.5, 2.0, 7), 1e4)
    b, inexact = random.standard_normal((2, 21))
    inexact = 0.3 * np.linalg.solve(matrix, b) + 1e-3 * inexact
    inexact *= np.sign(b @ inexact)

    def model(x):
        return 0.5 * x @ matrix @ x - b @ x

    x = without_net_force(translated(matrix), b, inexact)
    left = (b - matrix @ x).reshape(-1, 3).sum(axis=0)
    assert np.abs(left).max() < 1e-12 * np.abs(matrix @ x).max()
    assert np.abs((b - matrix @ inexact).reshape(-1, 3).sum(axis=0)).max() > 0.1
    assert model(x) < model(inexact)
    assert np.ptp((x - inexact).reshape(-1, 3), axis=0) == pytest.approx(0.0, abs=1e-12)


def test_translations_without_positive_stiffness_change_nothing():
    matrix = chain(np.full(5, -1.0), 1e3)
    b = np.ones(15)
    x = b.copy()
    assert without_net_force(translated(matrix), b, x) is x
    assert without_net_force(np.full((3, 15), np.nan), b, x) is x


def test_a_translation_that_leads_uphill_is_not_taken():
    """b'x > 0 of the inexact x, and < 0 with the translation: here the model itself is of little use so far out."""
    matrix, b = chain(np.ones(2), 1.0), np.array([1.0, 0, 0, 0, 0, 0])
    x = np.array([10.0, 0, 0, 10.0, 0, 0])
    moved = x + np.tile([-9.5, 0.0, 0.0], 2)
    assert without_net_force(translated(matrix), b, x) == pytest.approx(moved)
    far = np.array([1.0, 0, 0, 30.0, 0, 0])
    assert b @ far > 0.0
    assert without_net_force(translated(matrix), b, far) is far


@pytest.mark.parametrize("seed", range(20))
def test_a_matrix_is_positive_where_its_eigenvalues_are(seed):
    rng = np.random.default_rng(seed)
    rotation = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    values = rng.standard_normal(3) + 0.7
    assert _is_positive((rotation * values) @ rotation.T) == (values.min() > 0.0)
    assert not _is_positive(np.diag([0.0, 1.0, 1.0]))
    assert not _is_positive(np.full((3, 3), np.nan))


def test_the_first_step_is_the_projected_hessian_s_and_the_second_the_exact_one_s():
    assert not PROJECTED.exact
    assert PROJECTED.after(1.0, negative_curvature=False, noise=False).exact


def test_the_radius_doubles_while_bending_steps_are_taken_whole_up_to_its_bound():
    trust = Trust(projected=0)
    for _ in range(20):
        grown = trust.after(1.0, negative_curvature=True, noise=False)
        assert grown.radius == min(2 * trust.radius, MAX_RADIUS)
        trust = grown
    assert trust.radius == MAX_RADIUS


def test_a_step_that_was_cut_or_did_not_bend_halves_it_down_to_its_least():
    assert Trust(24.0, projected=0).after(0.5, negative_curvature=True, noise=False).radius == 12.0
    assert Trust(24.0, projected=0).after(1.0, negative_curvature=False, noise=False).radius == 12.0
    assert Trust(MIN_RADIUS, projected=0).after(0.5, negative_curvature=True, noise=False).radius == MIN_RADIUS


def test_after_round_off_the_pause_doubles_and_ends():
    trust, pauses = Trust(projected=0), []
    for _ in range(3):
        trust = trust.after(1.0, negative_curvature=True, noise=True)
        steps = 0
        while not trust.exact:
            trust, steps = trust.after(1.0, negative_curvature=False, noise=False), steps + 1
        pauses.append(steps)
    assert pauses == [2, 4, 8]
