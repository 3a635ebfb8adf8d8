"""Richardson against made-up fields of known order, whose limit is known."""

import numpy as np
import pytest

from clothsim.study.reference_solution import Norm, limit, observed_order

RANDOM = np.random.default_rng(1)
EXACT, A, B = RANDOM.standard_normal((3, 7, 3))
NORM = Norm(np.full(7, 1 / 7))


def field(h, order=2.0):
    return EXACT + h**order * A


def test_the_norm_is_weighted_rms():
    weights = np.array([0.25, 0.75])
    assert Norm(weights)(np.array([[3.0, 4.0], [0.0, 0.0]])) == pytest.approx(2.5)


@pytest.mark.parametrize("order", [0.8, 1.0, 2.0, 3.1])
def test_a_pure_power_gives_its_order_and_its_limit(order):
    sweep = {k: field(0.5 / 2**k, order=order) for k in (-1, 0, 1)}
    assert observed_order(sweep[-1], sweep[0], sweep[1], 2, NORM) == pytest.approx(order)
    found = limit(sweep, 2, 2.0 if order > 1.5 else 1.0, NORM)
    assert found.extrapolated
    assert found.order == pytest.approx(order)
    assert found.field == pytest.approx(EXACT, abs=1e-12)
    expected, last = 2.0 if order > 1.5 else 1.0, NORM(sweep[1] - sweep[0])
    assert found.error == pytest.approx(last * abs(1 / (2**order - 1) - 1 / (2**expected - 1)), abs=1e-12)


def test_the_stated_error_covers_the_next_term():
    sweep = {k: EXACT + A / 2**k + 0.3 * B / 4**k for k in (-1, 0, 1, 2)}
    found = limit(sweep, 2, 1.0, NORM)
    assert NORM(found.field - EXACT) < found.error < NORM(sweep[2] - EXACT)


def test_two_levels_take_the_expected_order_and_doubt_all_of_it():
    found = limit({0: field(0.5), 1: field(0.25)}, 2, 2.0, NORM)
    assert found.field == pytest.approx(EXACT)
    assert found.error == pytest.approx(NORM(field(0.25) - EXACT))


@pytest.mark.parametrize(
    ("sweep", "expected", "noise"),
    [
        ({0: EXACT, 1: EXACT + A, 2: EXACT + 4 * A}, 1.0, 0.0),  # it grows
        ({0: field(0.5), 1: field(0.25), 2: field(0.125)}, None, 0.0),  # no order is expected
        ({0: field(0.5), 1: field(0.25), 2: field(0.125)}, 2.0, 10.0),  # noise is larger
    ],
)
def test_what_has_no_order_is_not_extrapolated(sweep, expected, noise):
    found = limit(sweep, 2, expected, NORM, noise)
    assert not found.extrapolated
    assert np.array_equal(found.field, sweep[2])
    assert found.error >= NORM(sweep[2] - sweep[1])


@pytest.mark.parametrize("order", [0.0, 0.2, 0.4])
def test_differences_that_hardly_fall_doubt_more_than_the_last_of_them(order):
    sweep = {0: EXACT, 1: EXACT + A, 2: EXACT + A * (1 + 2.0**-order)}
    found = limit(sweep, 2, 1.0, NORM)
    left = NORM(A) * 2.0**-order / (2 ** max(order, 0.25) - 1)
    assert found.error == pytest.approx(left)
    assert left > 2 * NORM(sweep[2] - sweep[1])
