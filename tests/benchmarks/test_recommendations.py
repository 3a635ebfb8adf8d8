"""Recommendation against an independent run."""

from dataclasses import replace

import pytest
from analytic_study import SHEET

from clothsim.base.errors import InputError
from tests.benchmarks.recommendations import Promise, main, promises

FALL = replace(
    SHEET,
    cloth={**SHEET.cloth, "cells": [2, 2]},
    effects={"inertia": {}, "gravity": {}},
    run={"duration": 0.16},
)


def test_free_fall_is_wrong_by_g_T_dt_over_2():  # noqa: N802
    """Backward Euler falls g T dt/2 too far (docs/validation.md, A4): 15.7 mm with dt = .02; half one level finer."""
    study = {
        "recommended": [
            {"error": 20.0, "label": "base", "measured_error": 15.7},
            {"error": 10.0, "label": "dt +1", "measured_error": 7.85},
            {"error": 20.0, "label": "dt -1, tolerance +1", "measured_error": 2.0},
        ]
    }
    found = promises(FALL, study, {"dt": 4})
    assert [each.found for each in found] == pytest.approx([15.7, 7.85, 31.4], rel=0.01)
    assert [each.holds for each in found] == [True, True, False]
    assert all(each.resolved for each in found)


def test_a_factor_of_two_either_way():
    assert Promise(5, "", 2.0, 4.0).holds
    assert not Promise(5, "", 2.0, 0.9).holds


def test_a_prediction_below_the_comparison_error_is_unresolved():
    assert Promise(5, "", 2.0, 4.0, doubt=1.0).resolved
    assert not Promise(5, "", 2.0, 4.0, doubt=1.1).resolved


def test_bad_input_is_a_sentence(tmp_path, capsys):
    assert main(["missing.toml", str(tmp_path)]) == 2
    assert "missing.toml" in capsys.readouterr().err
    with pytest.raises(InputError, match="no data point"):
        promises(
            replace(FALL, solver={**FALL.solver, "max_iterations": 1, "tolerance": 1e-12}), {"recommended": []}, {}
        )
