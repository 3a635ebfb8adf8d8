"""Error of the time steps from two difference formulas and the certificate, on made-up fields."""

from dataclasses import replace

import numpy as np
import pytest

from clothsim.study.reference_solution import SPREAD, Norm, limit, not_below, with_other_formula

RANDOM = np.random.default_rng(2)
EXACT, A, B, D = RANDOM.standard_normal((4, 9, 3))
NORM = Norm(np.full(9, 1 / 9))


def euler(levels=(-1, 0, 1)):
    return {k: EXACT + A / 2.0**k for k in levels}


def bdf2(levels=(0, 1)):
    return {k: EXACT + 0.5 * B / 4.0**k for k in levels}


def both(sweep, order, other, other_order, second_order):
    return with_other_formula(sweep, limit(sweep, 2, order, NORM), other, other_order, second_order, NORM)


@pytest.mark.parametrize("levels", [(0, 1), (-1, 0, 1)])
def test_formulas_that_meet_leave_the_error_known(levels):
    found = both(euler(), 1.0, bdf2(levels), 2.0, second_order=True)
    adds = NORM(euler()[0] - found.field)
    assert adds == pytest.approx(NORM(A), rel=0.3)
    assert NORM(found.field - EXACT) <= found.error + 1e-12
    assert found.error < 0.5 * adds


def test_a_base_of_bdf2_is_compared_with_the_limit_of_backward_euler():
    found = both(bdf2((-1, 0, 1)), 2.0, euler((0, 1)), 1.0, second_order=False)
    assert NORM(found.field - EXACT) < 1e-12
    assert found.error < 0.1 * NORM(B)


def test_a_false_limit_of_backward_euler_is_doubted():
    """It damps what BDF2 shows: its sweep is regular, and ends beside the solution."""
    damped = {k: each + D for k, each in euler().items()}
    found = both(damped, 1.0, bdf2(), 2.0, second_order=True)
    assert found.error >= NORM(found.field - EXACT) - 1e-12
    assert found.doubt > 0.5 * NORM(D)


def test_formulas_that_do_not_meet_are_doubted_whichever_is_given():
    shifted = {k: each + D for k, each in euler((0, 1)).items()}
    found = both(bdf2((-1, 0, 1)), 2.0, shifted, 1.0, second_order=False)
    assert found.doubt == pytest.approx(NORM(D) - NORM(A / 2), rel=1e-9)


def test_one_run_of_bdf2_bounds_a_base_of_backward_euler():
    stalled = {0: EXACT + A, 1: EXACT + A + 1e-3 * B}
    found = both(stalled, 1.0, {0: EXACT}, 2.0, second_order=True)
    assert found.error == pytest.approx(NORM(A), rel=0.01)


def test_the_certificate_holds_unless_a_finer_dt_shows_less():
    estimate = 10 * NORM(A)
    regular = limit(euler(), 2, 1.0, NORM)
    assert not_below(estimate, euler(), regular, {}, NORM) == regular
    two = {0: EXACT + A, 1: EXACT + A / 2}
    own = limit(two, 2, 1.0, NORM)
    alone = not_below(estimate, two, own, {}, NORM)
    assert alone.error == pytest.approx(estimate - NORM(A))
    shown = not_below(estimate, two, own, bdf2(), NORM)
    furthest = max(NORM(two[0] - each) for each in (two[1], *bdf2().values()))
    assert shown.error == pytest.approx(max(own.error, SPREAD * furthest))
    assert not_below(0.0, two, own, {}, NORM) == own
    assert replace(alone, error=own.error, doubt=0.0) == own
