"""Gauss and Newton's search on sums without runs: its end, its limits, failures beside it, and known derivatives."""

from dataclasses import dataclass

import numpy as np
import pytest

from clothsim import ClothsimError
from clothsim.gradients.clips.gauss_newton import Search

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
    return Search(run, run, linearised, 0.01 * k, 0.5 * k, -limit * k, limit * k, **others)


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
