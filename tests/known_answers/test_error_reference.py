"""Reference of a scene: three levels show how far the finest is from the limit."""

import numpy as np
import pytest

from tests.benchmarks.own_errors import verdict
from tests.known_answers.error_reference import Refinement, doubt_of, truth
from tests.known_answers.error_scenes import ERROR_SCENES

FIRST, THEN, LAST = (Refinement(dt, cells, d_hat) for dt, cells, d_hat in ((4, 1, 2), (8, 2, 4), (16, 4, 8)))


@pytest.mark.parametrize("ratio", [1.5, 2.0, 4.0])
def test_the_doubt_of_a_geometric_series_is_what_is_left(ratio):
    errors = 1e-3 / ratio ** np.arange(3)
    assert doubt_of(errors[0] - errors[1], errors[1] - errors[2]) == pytest.approx(errors[2])


def test_three_solutions_that_do_not_converge_are_no_truth():
    assert doubt_of(1e-3, 1e-3) == np.inf
    assert doubt_of(1e-3, 2e-3) == np.inf


def test_a_coincidence_of_the_coarse_runs_is_no_higher_order():
    assert doubt_of(1.0, 1e-3) == pytest.approx(1e-3 / 3)
    assert doubt_of(0.0, 0.0) == 0.0


def test_each_level_is_coarser_in_all_three():
    assert LAST.coarser == THEN
    assert THEN.coarser == FIRST


def test_the_truth_is_the_finest_of_three_runs(monkeypatch):
    runs = {FIRST: 4.0, THEN: 2.0, LAST: 1.5}
    monkeypatch.setattr("tests.known_answers.error_reference.reference_scene", lambda scene, level: level)
    monkeypatch.setattr("tests.known_answers.error_reference.solution", lambda level: runs[level])
    monkeypatch.setattr("tests.known_answers.error_reference.distance", lambda one, other: abs(one - other))
    found = truth(ERROR_SCENES["twisted"], LAST)
    assert found.solution == 1.5
    assert found.doubt == pytest.approx(0.5 / 3)


def test_a_verdict_needs_every_truth_within_the_doubt():
    assert verdict(1.0, 0.6) == verdict(1.0, 1.9, 0.1) == "right"
    assert verdict(1.0, 1.9, 0.2) == verdict(1.0, 0.6, np.inf) == "truth not known"
    assert verdict(1.0, 2.3, 0.2) == verdict(1.0, 0.3, 0.1) == "WRONG"
    assert verdict(float("nan"), 1.0, 0.1) == "not known"
