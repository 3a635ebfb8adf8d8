"""Finite-difference checker: wrong derivatives fail, right ones pass."""

import numpy as np
import pytest
from differences import gradient_error, hessian_error, taylor_slopes

from clothsim.physics.energies.base import Energy
from clothsim.physics.energies.hessians import ElementHessian


class Quartic(Energy):
    """E = sum |x_i|^4 / 4 with ways to be wrong."""

    def __init__(self, gradient=lambda g: g, hessian=lambda h: h):
        self.change_gradient, self.change_hessian = gradient, hessian

    def value(self, x):
        return float(((x**2).sum(axis=1) ** 2).sum() / 4)

    def gradient(self, x):
        return self.change_gradient((x**2).sum(axis=1)[:, None] * x)

    def hessian(self, x, project=True):
        blocks = (x**2).sum(axis=1)[:, None, None] * np.eye(3) + 2 * x[:, :, None] * x[:, None, :]
        return self.change_hessian(ElementHessian(np.arange(len(x))[:, None], blocks))


X = np.random.default_rng(0).standard_normal((4, 3))


def one_entry_off(gradient):
    gradient = gradient.copy()
    gradient[2, 1] *= 1.001
    return gradient


def blocks(change):
    return lambda h: ElementHessian(h.elements, change(h.blocks))


def test_a_right_energy_passes():
    assert gradient_error(Quartic(), X) < 1e-8
    assert hessian_error(Quartic(), X) < 1e-8
    first, second = taylor_slopes(Quartic(), X)
    assert first == pytest.approx(2, abs=0.1)
    assert second == pytest.approx(3, abs=0.1)


@pytest.mark.parametrize("wrong", [np.negative, lambda g: 1.001 * g, one_entry_off, np.round])
def test_a_wrong_gradient_is_caught(wrong):
    assert gradient_error(Quartic(gradient=wrong), X) > 1e-5
    assert hessian_error(Quartic(), X) < 1e-8


@pytest.mark.parametrize("wrong", [np.negative, lambda g: 1.01 * g])
def test_a_wrong_gradient_shows_in_the_first_slope(wrong):
    assert taylor_slopes(Quartic(gradient=wrong), X)[0] < 1.5


@pytest.mark.parametrize("wrong", [np.negative, lambda b: 1.01 * b, lambda b: b.astype(int), lambda b: 0.5 * b])
def test_a_wrong_hessian_is_caught_by_difference_and_slope(wrong):
    energy = Quartic(hessian=blocks(wrong))
    assert hessian_error(energy, X) > 1e-3
    assert taylor_slopes(energy, X)[1] < 2.6


@pytest.mark.parametrize(
    "nothing",
    [blocks(np.zeros_like), lambda h: ElementHessian(np.zeros((0, 1), np.int64), np.zeros((0, 3, 3)))],
    ids=["zero", "empty"],
)
def test_a_hessian_of_nothing_is_refused(nothing):
    with pytest.raises(AssertionError, match="over nothing"):
        hessian_error(Quartic(hessian=nothing), X)


def test_a_gradient_of_nothing_is_refused():
    with pytest.raises(AssertionError, match="over nothing"):
        gradient_error(Quartic(gradient=np.zeros_like), X)


def test_no_vertex_is_refused():
    with pytest.raises(AssertionError, match="over nothing"):
        gradient_error(Quartic(), np.zeros((0, 3)))


@pytest.mark.parametrize("where", [(0, 0), (slice(None), slice(None))], ids=["one entry", "all"])
def test_nan_is_refused(where):
    def spoilt(gradient):
        gradient = gradient.copy()
        gradient[where] = np.nan
        return gradient

    with pytest.raises(AssertionError):
        gradient_error(Quartic(gradient=spoilt), X)
