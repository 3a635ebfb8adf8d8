"""Estimate of three runs: exact where the order is as assumed, not known where the differences do not fall."""

import pytest

from clothsim.study.error_control.parameter_errors import FALL, FALL_IN_CONTACT, ORDER, ORDER_IN_CONTACT, from_three

SMOOTH, CONTACT = ("dt", "cells"), ("dt", "cells", "d_hat")


@pytest.mark.parametrize(("parameters", "order"), [(SMOOTH, ORDER), (CONTACT, ORDER_IN_CONTACT)])
def test_an_error_of_the_assumed_order_is_found(parameters, order):
    errors = [2e-3 * factor**order for factor in (1, 2, 4)]
    found = from_three(errors[1] - errors[0], errors[2] - errors[1], parameters)
    assert found.error == pytest.approx(2e-3)
    assert found.reason == ""


@pytest.mark.parametrize("parameters", [SMOOTH, CONTACT])
def test_an_error_of_any_order_is_found_to_a_factor_of_two_or_not_known(parameters):
    known = 0
    for order in (0.3, 0.5, 0.73, 0.8, 1.0, 1.01, 1.2, 1.4, 1.8, 1.84, 2.0, 2.19, 2.5, 3.0):
        errors = [2e-3 * factor**order for factor in (1, 2, 4)]
        found = from_three(errors[1] - errors[0], errors[2] - errors[1], parameters)
        known += found.reason == ""
        assert found.reason or 0.5 <= found.error / 2e-3 <= 2
    assert known >= 6


@pytest.mark.parametrize(("parameters", "bounds"), [(SMOOTH, FALL), (CONTACT, FALL_IN_CONTACT)])
def test_differences_that_do_not_fall_as_they_should_tell_nothing(parameters, bounds):
    for ratio, known in ((0.99 * bounds[0], False), (1.01 * bounds[0], True), (0.99 * bounds[1], True)):
        assert (from_three(1e-3, ratio * 1e-3, parameters).reason == "") is known
    assert from_three(1e-3, 1.01 * bounds[1] * 1e-3, parameters).reason


def test_a_run_that_nothing_moves_has_no_error():
    found = from_three(0.0, 0.0, SMOOTH)
    assert (found.error, found.reason) == (0.0, "")


@pytest.mark.parametrize(
    ("name", "moved", "further", "parameters", "truth", "known"),
    [
        # mm, 2026-11-23, against dt / 16, cells x 4, d_hat / 8 (docs/howto/accuracy.md)
        ("wind, standard", 7.67, 13.54, SMOOTH, 8.67, False),
        ("wind, fine", 6.22, 7.67, SMOOTH, 2.69, False),
        ("compressed, fine", 1.71, 57.3, SMOOTH, 3.32, False),
        ("ball, fine", 11.9, 15.3, CONTACT, 2.73, False),
        ("ball, standard", 17.6, 22.8, CONTACT, 11.1, False),
        ("ball, as it is", 19.0, 27.9, CONTACT, 10.4, False),
        ("landing, standard", 0.71, 0.97, CONTACT, 1.18, False),
        ("twisted, standard", 1.17, 3.40, SMOOTH, 0.44, True),
        ("plate, fine", 2.03, 4.76, SMOOTH, 1.52, True),
        ("capsule, fine", 11.8, 27.3, CONTACT, 10.0, True),
    ],
)
def test_measured_runs_are_within_two_or_not_known(name, moved, further, parameters, truth, known):
    found = from_three(1e-3 * moved, 1e-3 * further, parameters)
    assert (found.reason == "") is known
    if known:
        assert 0.5 < 1e3 * found.error / truth < 2
