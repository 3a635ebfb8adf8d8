"""Plane-stress thickness against Wright's omega function, published digits and limits."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import wrightomega

from clothsim.base.errors import InputError
from clothsim.geometry.kinematics.thickness import deformed_thickness, thickness_stretch

STRAIN = 1e-6


def closed_form(J, nu):
    """l3^2 = (a/2) w with w + ln w = 2/a - 2 ln J + ln(2/a), a = lam3/mu3: Wright's omega function, 0 < nu < .5."""
    a = 2 * nu / (1 - 2 * nu)
    return np.sqrt(a / 2 * wrightomega(2 / a - 2 * np.log(J) + np.log(2 / a)))


def residual(l3, J, nu):
    """Residual of (1 - 2 nu)(l3^2 - 1) + 2 nu ln(J l3) = 0, relative to its largest term where that is above 1."""
    terms = np.array([(1 - 2 * nu) * l3**2, np.full_like(J, -(1 - 2 * nu)), 2 * nu * np.log(J), 2 * nu * np.log(l3)])
    return np.abs(terms.sum(0)) / (1 + np.abs(terms).max(0))


@pytest.mark.parametrize("nu", [1e-9, 1e-3, 0.1, 0.3, 0.45, 0.499, 0.4999999])
def test_against_the_closed_form(nu):
    J = np.logspace(-12, 12, 401)
    np.testing.assert_allclose(thickness_stretch(J, 1, nu), closed_form(J, nu), rtol=2e-14)


@pytest.mark.parametrize(("l1", "l3"), [(1.1, 0.95904309), (1.5, 0.82492364)])
def test_published_digits(l1, l3):
    """docs/results/validation.md A1: lam = 1.5 mu solves the same equation for l2; 2 nu/(1 - 2 nu) = 1.5 is nu = .3."""
    assert round(float(thickness_stretch(l1, 1, 0.3)), 8) == l3


@settings(max_examples=100, deadline=None)
@given(st.floats(-20, 20), st.floats(-20, 20), st.floats(0, 0.5))
def test_thickness_satisfies_plane_stress_and_depends_on_the_area_only(log_l1, log_l2, nu):
    l1, l2 = np.exp([log_l1, log_l2])
    l3 = thickness_stretch(l1, l2, nu)
    assert residual(np.atleast_1d(l3), np.atleast_1d(l1 * l2), nu) < 1e-13
    np.testing.assert_allclose(l3, thickness_stretch(l1 * l2, 1, nu), rtol=1e-12)
    low, high = sorted([1.0, 1 / (l1 * l2)])
    assert low * (1 - 1e-13) <= l3 <= high * (1 + 1e-13)


@pytest.mark.parametrize("nu", [-0.9, -0.3, 0.0, 0.2, 0.3, 0.49, 0.5])
@pytest.mark.parametrize("strains", [(1, 1), (2, -0.5), (-1, -1), (3, 0)])
def test_small_strains(nu, strains):
    e1, e2 = STRAIN * np.array(strains)
    l3 = thickness_stretch(1 + e1, 1 + e2, nu)
    np.testing.assert_allclose(l3 - 1, -nu / (1 - nu) * (e1 + e2), rtol=0, atol=20 * STRAIN**2)


def test_plane_stress_lam_underestimates_thinning_by_30_percent():
    """lam/mu = 2 nu/(1 - nu) in place of 2 nu/(1 - 2 nu) is equivalent to the correct equation at nu' = nu/(1 + nu)."""
    nu = 0.3
    wrong_nu = nu / (1 + nu)
    assert np.isclose(2 * wrong_nu / (1 - 2 * wrong_nu), 2 * nu / (1 - nu))
    right, wrong = (1 - thickness_stretch(1 + STRAIN, 1, n) for n in (nu, wrong_nu))
    np.testing.assert_allclose(wrong / right, 0.70, atol=1e-5)
    np.testing.assert_allclose(right, 3 / 7 * STRAIN, rtol=1e-5)


def test_limit_of_incompressibility():
    l1, l2 = np.array([0.6, 1.0, 1.3, 2.0]), np.array([0.9, 1.0, 0.8, 1.5])
    expected = thickness_stretch(l1, l2, 0.1, model="incompressible")
    np.testing.assert_array_equal(expected, np.exp(-np.log(l1) - np.log(l2)))
    np.testing.assert_allclose(expected, 1 / (l1 * l2), rtol=4e-15)
    gaps = [np.abs(thickness_stretch(l1, l2, 0.5 - gap) - expected).max() for gap in (1e-3, 1e-4, 1e-5)]
    np.testing.assert_allclose(np.divide(gaps[:-1], gaps[1:]), 10, rtol=0.02)
    np.testing.assert_allclose(thickness_stretch(l1, l2, 0.5), expected, rtol=4e-15)


def test_zero_poisson_ratio_keeps_the_thickness():
    np.testing.assert_array_equal(thickness_stretch([0, 0.5, 2], [1, 1, 3], 0.0), 1)


def test_poisson_ratio_per_triangle():
    nu = np.array([0.0, 0.2, 0.5])
    together = thickness_stretch([1.2, 1.2, 1.2], 1.1, nu)
    np.testing.assert_array_equal(together, [thickness_stretch(1.2, 1.1, n) for n in nu])
    assert (np.diff(together) < 0).all()


def test_deformed_thickness_is_rest_thickness_times_stretch():
    stretches, nu = np.array([[1.2, 1.0], [1.1, 0.9], [1.0, 1.0]]), np.array([0.1, 0.3, 0.5])
    rest = np.array([1e-3, 2e-3, 3e-3])
    found = deformed_thickness(stretches, rest, nu)
    np.testing.assert_array_equal(found, rest * thickness_stretch(*stretches.T, nu))
    assert found[2] == rest[2]


@pytest.mark.parametrize("nu", [0.01, 0.3, 0.5])
def test_extreme_stretches(nu):
    assert thickness_stretch(0.0, 1.0, nu) == np.inf
    assert thickness_stretch(1e-150, 1e-150, nu) > 1
    assert 0 <= thickness_stretch(1e150, 1e150, nu) < 1


@pytest.mark.parametrize("nu", [-1e-6, -0.2, -0.5, -0.95])
def test_auxetic_sheets_thicken_under_tension(nu):
    J = np.array([0.95, 1.0, 1.1, 2.0, 1e3])
    l3 = thickness_stretch(J, 1, nu)
    assert (residual(l3, J, nu) < 1e-14).all()
    assert (np.sign(l3 - 1) == np.sign(J - 1)).all()


def test_compressed_auxetic_sheet_without_equilibrium_is_refused():
    """nu = -.5: mu3 (l3^2 - 1) - mu3/2 ln(J l3) has its minimum at l3 = 1/2, above 0 for ln J < ln 2 - 3/2."""
    limit = np.exp(np.log(2) - 1.5)
    np.testing.assert_allclose(thickness_stretch(limit * (1 + 1e-12), 1, -0.5), 0.5, atol=1e-5)
    with pytest.raises(InputError, match=r"entry \[1\]"):
        thickness_stretch([1.0, limit * (1 - 1e-12)], 1, -0.5)
    with pytest.raises(InputError, match="poisson_ratio"):
        thickness_stretch(0.0, 1.0, -0.5)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (([1, -0.1], 1, 0.3), r"l1\[1\] .*0.* -0.1"),
        ((1, -1, 0.3), r"^l2 .*-1"),
        ((1, np.nan, 0.3), r"^l2 .*nan"),
        ((1, 1, 0.6), r"^poisson_ratio .*\(-1, 0.5\].* 0.6"),
        ((1, 1, [0.2, -1]), r"^poisson_ratio\[1\]"),
        ((1, 1, 0.3, "rubber"), r"'rubber'.*neo_hookean, incompressible"),
    ],
)
def test_bad_input_is_named(arguments, words):
    with pytest.raises(InputError, match=words):
        thickness_stretch(*arguments)
