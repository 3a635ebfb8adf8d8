"""Stopping rule: predicted remaining change, bounds, and the balance against a time error."""

import numpy as np
import pytest

from clothsim.solve.newton.convergence import (
    FEWEST,
    FEWEST_UNSTABLE,
    FIRST_FORCE,
    LONGEST_END,
    MOST_SPEED,
    ErrorBalance,
    LastStep,
    MotionStop,
    StaticStop,
    remaining_change,
)


def balance_of(rms=1e-3, largest=1e-2, fraction=0.1):
    return ErrorBalance(fraction, 4, lambda x: (rms, largest))


def step_of(length):
    """Four cloth vertices that move by `length` along x, and one of a body that moves by a metre."""
    dx = np.zeros((5, 3))
    dx[:4, 0], dx[4, 1] = length, 1.0
    return dx


def reached(balance, length, before, dt=1.0):
    dx = step_of(length)
    dx[4] = 0.0
    last = LastStep(9, False, balance.rms(dx, exact=True), np.array([before]))
    return balance.reached(np.zeros_like(dx), dx, last, dt)


def test_a_linear_rate_gives_the_rest_of_its_series():
    for rate in (0.6, 0.9, 0.99):
        lengths = rate ** np.arange(5000)
        assert remaining_change(lengths[3:4], lengths[2:3]) == pytest.approx(lengths[4:].sum(), rel=1e-6)


@pytest.mark.parametrize(("step", "before"), [(1.0, np.inf), (1.0, 1.0), (2.0, 1.0), (np.inf, np.inf)])
def test_one_step_alone_and_steps_that_grow_predict_nothing(step, before):
    assert remaining_change(np.array([step]), np.array([before])) == np.inf


def test_rms_counts_cloth_vertices_alone():
    assert balance_of().rms(step_of(3.0), exact=True) == pytest.approx([3.0])
    assert balance_of().rms(step_of(3.0), exact=False) == np.inf


def test_a_fraction_of_the_time_error_ends_a_solve():
    assert reached(balance_of(), 0.9e-4, before=1.0)
    assert not reached(balance_of(), 1.1e-4, before=1.0)
    assert not reached(balance_of(), 0.9e-4, before=1e-4)  # the rate of .9 leaves nine times the step
    assert not reached(balance_of(fraction=0.01), 0.9e-4, before=1.0)


def test_the_largest_vertex_counts_too():
    assert not reached(balance_of(rms=1.0, largest=1e-4), 0.9e-4, before=1.0)


def test_a_huge_time_error_does_not_end_a_solve_at_any_step():
    balance, dt = balance_of(rms=1e3, largest=1e3), 0.01
    most = MOST_SPEED * 0.1 * dt
    assert reached(balance, 0.99 * most, before=1.0, dt=dt)
    assert not reached(balance, 1.01 * most, before=1.0, dt=dt)


def test_without_a_fraction_only_the_tolerance_ends_a_solve():
    assert not reached(balance_of(rms=1e3, largest=1e3, fraction=0.0), 1e-12, before=1.0)
    assert balance_of(fraction=0.0).force_fraction(first=True, without=0.3) == 0.3


def test_forces_balance_better_after_a_single_step():
    balance = balance_of()
    assert balance.force_fraction(first=False, without=0.3) == pytest.approx(0.1)
    assert balance.force_fraction(first=True, without=0.3) == pytest.approx(0.1 * FIRST_FORCE)


def motion(errors=(1e-3, 1e-3), fraction=0.3, cell=1.0, least=1e-9):
    """A stop over a sheet of a thousand rows and a collar of ten."""
    return MotionStop(fraction, (slice(0, 1000), slice(1000, 1010)), lambda x: np.array(errors), cell, least)


def moved(sheet, collar):
    dx = np.zeros((1010, 3))
    dx[:1000, 0], dx[1000:, 0] = sheet, collar
    return dx


def ends(stop, dx, iteration=9, negative=False, before=1.0):
    last = LastStep(iteration, negative, stop.rms(dx, exact=True), np.full(2, before))
    return stop.reached(np.zeros_like(dx), dx, last, dt=0.01)


def test_a_motion_below_the_time_error_of_each_body_ends_a_solve():
    assert ends(motion(), moved(0.29e-3, 0.29e-3))
    assert not ends(motion(), moved(0.31e-3, 0.0))
    assert not ends(motion(), moved(0.0, 0.31e-3))  # ten rows of 1,010: .03e-3 in the mean of all
    assert not ends(motion(errors=(1.0, 1e-6)), moved(0.0, 1e-3))


def test_one_vertex_that_moves_far_does_not_keep_a_body_going():
    dx = moved(0.0, 0.0)
    dx[7, 2] = 5e-3  # 5e-3 / 1000^1/2 = .16e-3
    assert ends(motion(), dx)


def test_a_step_that_ends_a_solve_is_bounded_by_cells_and_by_a_least_length():
    assert not ends(motion(errors=(1e3, 1e3), cell=0.01), moved(1.01 * LONGEST_END * 0.01, 0.0))
    assert ends(motion(errors=(1e3, 1e3), cell=0.01), moved(0.99 * LONGEST_END * 0.01, 0.0))
    assert ends(motion(errors=(0.0, 0.0), least=1e-6), moved(0.99e-6, 0.99e-6))


def test_the_first_steps_of_a_solve_do_not_end_it():
    still = moved(0.0, 0.0)
    assert [ends(motion(), still, k) for k in (FEWEST - 1, FEWEST)] == [False, True]
    assert [ends(motion(), still, k, negative=True) for k in (FEWEST_UNSTABLE - 1, FEWEST_UNSTABLE)] == [False, True]


def test_steps_that_do_not_contract_do_not_end_a_solve():
    """A card held by friction makes a small step before it slips."""
    assert not ends(motion(), moved(1e-4, 1e-4), before=1e-5)
    assert not ends(motion(), moved(1e-4, 1e-4), before=1.2e-4)  # a rate of .83 leaves five times the step
    assert ends(motion(), moved(1e-4, 1e-4), before=2e-4)


def test_a_quasi_static_solve_ends_at_a_fraction_of_what_it_moved_or_of_a_cell():
    start = np.zeros((4, 3))
    stop = StaticStop(1e-3, 4, start=start, cell=0.01)

    def ends(moved, step):
        dx = np.full((4, 3), step)
        return stop.reached(start + moved - dx, dx, LastStep(1, False, np.array([np.inf]), np.array([np.inf])), 1.0)

    assert ends(1e-3, 0.9e-6)
    assert not ends(1e-3, 1.1e-6)
    assert ends(1.0, 0.9e-5)  # a thousandth of a cell
    assert not ends(1.0, 1.1e-5)
    assert not ends(1e-6, 1e-6)  # beside a saddle a step is all that moved
    assert ends(0.9e-8, 0.9e-8)  # nothing to move


def test_the_time_error_is_that_at_the_end_of_the_step():
    seen = []
    stop = MotionStop(0.3, (slice(0, 4),), lambda x: seen.append(x) or np.ones(1), 1.0, 1e-9)
    x, dx = np.arange(12.0).reshape(4, 3), np.full((4, 3), 0.25)
    assert stop.reached(x, dx, LastStep(9, False, np.array([1e-3]), np.array([1.0])), 1.0)
    assert np.array_equal(seen[0], x + dx)
