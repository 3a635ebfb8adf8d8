"""Pareto front and recommendations on prescribed errors."""

import numpy as np
import pytest

from clothsim.study.analysis import (
    cheapest_within,
    pareto_front,
    predicted_errors,
    round_targets,
    worth_trying,
)
from clothsim.study.points import point
from clothsim.study.reference_solution import Norm


def test_the_front_is_what_nothing_beats():
    seconds, errors = [3.0, 1.0, 2.0, 2.0, 4.0, 5.0], [2.0, 9.0, 4.0, 3.0, 2.0, 1.0]
    assert pareto_front(seconds, errors) == [1, 3, 0, 5]
    assert pareto_front([], []) == []


def test_the_front_of_random_points_beats_every_other():
    random = np.random.default_rng(0)
    seconds, errors = random.uniform(size=(2, 200))
    front = pareto_front(seconds, errors)
    for row in range(200):
        beaten = any(seconds[k] <= seconds[row] and errors[k] <= errors[row] for k in front)
        assert beaten
        assert (row in front) == (not any((seconds < seconds[row]) & (errors < errors[row])))


def test_errors_are_added_as_fields_not_as_numbers():
    norm = Norm(np.array([1.0]))
    own = {"a": {0: np.array([[3.0, 0.0]]), 1: np.zeros((1, 2))}, "b": {0: np.array([[-1.0, 0.0]]), -1: [[0.0, 4.0]]}}
    own["b"][-1] = np.array(own["b"][-1])
    combinations, errors = predicted_errors(own, norm)
    found = {(each["a"], each["b"]): error for each, error in zip(combinations, errors, strict=True)}
    assert found == {(0, 0): 2.0, (0, -1): 5.0, (1, 0): 1.0, (1, -1): 4.0}


def test_what_is_worth_trying_is_few_and_on_the_front():
    combinations = [{"a": k} for k in range(6)]
    chosen = worth_trying(combinations, [9.0, 8.9, 4.0, 5.0, 2.0, 1.0], [1, 2, 3, 4, 5, 6], most=3)
    assert chosen == [point({}), point({"a": 4}), point({"a": 5})] or chosen == [
        point({}),
        point({"a": 2}),
        point({"a": 5}),
    ]


def test_targets_are_round_and_enclose_the_errors():
    assert round_targets([0.3, 7.0]) == [0.5, 1.0, 2.0, 5.0, 10.0]
    assert round_targets([2.0]) == [2.0]
    assert round_targets([0.0, 1.0]) == []


def test_the_cheapest_within_a_target():
    assert cheapest_within(2.0, [5.0, 3.0, 1.0], [1.0, 2.0, 3.0]) == 1
    assert cheapest_within(0.5, [5.0, 3.0], [1.0, 2.0]) is None


@pytest.mark.parametrize("levels", [{"dt": 1, "cells": -1}, {"cells": -1, "dt": 1, "d_hat": 0}])
def test_equal_settings_are_equal_points(levels):
    assert point(levels) == point({"dt": 1, "cells": -1})
