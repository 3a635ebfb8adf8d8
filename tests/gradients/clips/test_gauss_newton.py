"""Gauss and Newton's search on sums without runs: its end, its limits, failures beside it, and known derivatives."""

from dataclasses import dataclass

import numpy as np
import pytest

from clothsim import ClothsimError
from clothsim.gradients.clips.gauss_newton import (
    HALVINGS,
    GaussNewton,
    LineSearch,
    broyden_update,
    halved_until_lower,
    vertex,
)

TARGET = np.array([np.exp(0.6), np.exp(-0.4), 2.0])


@dataclass(frozen=True, eq=False)
class Seen:
    at: np.ndarray
    total: float
    positions: np.ndarray
    failure: str = ""


def seen(at, _=None):
    x = np.array([np.exp(at[0]), np.exp(at[1]), at[0] + 1.4])
    return Seen(at, 0.5e4 * float(((x - TARGET) ** 2).sum()), x)


def linearised(one, moves):
    return 1e4 * moves.T @ (one.positions - TARGET), 1e4 * moves.T @ moves


def search(run=seen, limit=3.0, **others):
    k = np.ones(2)
    return GaussNewton(run, run, linearised, 0.01 * k, 0.5 * k, -limit * k, limit * k, **others)


def test_it_ends_at_the_minimum_and_counts_its_runs():
    taken = []
    last, _, moves, runs = search(tell=taken.append).descended(seen(np.zeros(2)))
    np.testing.assert_allclose(last.at, [0.6, -0.4], atol=1e-2)
    np.testing.assert_allclose(moves[0], [np.exp(0.6), 0.0], atol=0.02)
    assert runs == len(taken) + 1


def test_numbers_stay_within_their_limits():
    last = search(limit=0.3).descended(seen(np.zeros(2)))[0]
    np.testing.assert_allclose(last.at, [0.3, -0.3], atol=1e-9)


def test_known_derivatives_are_not_taken_again():
    taken = []
    begin = seen(np.zeros(2))
    own = search(tell=taken.append, least=0.9)
    moves = own.moves(begin)
    count = len(taken)
    own.descended(begin, moves)
    assert count == 2
    assert np.abs(taken[count].at).max() > 0.1  # a step, no difference


def test_a_run_that_fails_on_one_side_is_taken_on_the_other():
    def one_sided(at, _):
        return seen(at) if at[1] <= 0 else Seen(at, float("inf"), np.zeros(0))

    np.testing.assert_allclose(search(one_sided).moves(seen(np.zeros(2)))[1], [0.0, 1.0], atol=0.01)
    with pytest.raises(ClothsimError, match="torn"):
        search(lambda at, _: Seen(at, float("inf"), np.zeros(0), "torn")).moves(seen(np.zeros(2)))


def test_a_difference_that_jumps_to_another_branch_is_taken_on_the_other_side():
    def jumping(at, _):
        one = seen(at)
        return Seen(at, one.total, one.positions + 5.0 * (at[0] > 0.005))

    moves = search(jumping, both_sides=True).moves(seen(np.zeros(2)))
    np.testing.assert_allclose(moves[:, 0], [1.0, 0.0, 1.0], atol=0.01)
    assert abs(search(jumping).moves(seen(np.zeros(2)))[0, 0]) > 100


def test_both_sides_are_counted():
    taken = []
    *_, runs = search(tell=taken.append, both_sides=True).descended(seen(np.zeros(2)))
    assert runs == len(taken) + 1


def test_updated_derivatives_give_the_change_and_nothing_across_it():
    rng = np.random.default_rng(0)
    moves, positions = rng.standard_normal((6, 3)), rng.standard_normal((2, 2, 3))
    before = Seen(np.array([0.1, 0.2, 0.3]), 0.0, positions[0])
    after = Seen(np.array([0.4, 0.2, -0.1]), 0.0, positions[1])
    updated, moved = broyden_update(moves, before, after), after.at - before.at
    np.testing.assert_allclose(updated @ moved, (positions[1] - positions[0]).ravel(), atol=1e-12)
    across = np.array([0.4, 0.7, 0.3])  # at a right angle to the step
    np.testing.assert_allclose(updated @ across, moves @ across, atol=1e-12)


def test_a_step_is_halved_until_the_sum_is_lower():
    start, tried, step = Seen(np.zeros(1), 1.0, np.zeros(1)), [], np.array([4.0])
    lower, runs = halved_until_lower(lambda at, _: Seen(at, (at[0] - 1) ** 2, at), start, step, tried.append)
    assert lower.at[0] == 1.0
    assert runs == len(tried) == 3
    none, runs = halved_until_lower(lambda at, _: Seen(at, 2.0, at), start, step, tried.append)
    assert none is None
    assert runs == HALVINGS + 1


def scanned(total, step):
    """The lowest place along a line of sums, and the places of the runs."""
    seen = []

    def run(q):
        seen.append(q)
        return Seen(np.array([q]), total(q), np.zeros((1, 3)))

    line = LineSearch(run, {0.0: run(0.0)}, step, 4.6)
    line.begin()
    line.double()  # which takes no run again
    return line.refined().at[0], seen[1:]


@pytest.mark.parametrize("failing", [np.inf, 2.0])
def test_a_line_is_searched_beyond_a_step_to_the_wrong_side(failing):
    """The sum is lowest at 1.5; runs from `failing` on have no end."""
    lowest, seen = scanned(lambda q: (q - 1.5) ** 2 if q < failing else np.inf, -0.7)
    assert lowest == pytest.approx(1.5)
    assert seen[:4] == pytest.approx([-0.7, 0.7, 1.4, 2.8])


def test_a_line_along_which_nothing_is_lower_takes_three_runs():
    lowest, seen = scanned(abs, 1.0)
    assert lowest == 0
    assert len(seen) == 3


def test_a_line_ends_at_its_limit_and_where_it_is_near_enough():
    assert max(scanned(lambda q: -q, 1.0)[1]) == 4.0
    line = LineSearch(
        lambda q: Seen(np.array([q]), (q - 1.5) ** 2, np.zeros((1, 3))), {}, 1.0, 4.6, lambda seen: seen.total < 1.0
    )
    line.runs[0.0] = line.run(0.0)
    line.double()
    assert line.refined().total == 0.25
    assert len(line.runs) == 3


def test_a_parabola_of_totals_that_agree_to_rounding_is_lowest_between_them():
    """Its coefficients are rounding: from such numbers 15.5 without a bound."""
    rounding = np.spacing(1e3)
    assert 0.7 <= vertex([(0.7, 1e3 + 2 * rounding), (1.4, 1e3), (2.8, 1e3 + rounding)]) <= 2.8
