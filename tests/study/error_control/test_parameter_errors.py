"""Errors by parameter from differences of runs: model problems with known errors."""

import numpy as np
import pytest

from clothsim.study.error_control.parameter_errors import (
    LEAST_CALIBRATION,
    ParameterErrors,
    from_all,
    from_path,
    orders,
)


def test_an_error_of_the_assumed_order_is_found_from_two_runs():
    at = {"dt": 0.5, "cells": 0.5}
    exact = {"dt": 3e-3, "cells": 2e-3}
    left = {name: error * 0.5 ** orders(at)[name] for name, error in exact.items()}
    moved = {name: exact[name] - left[name] for name in exact}
    found = from_path(at, moved, {"dt": 2.0, "cells": 2.0})
    assert found.errors == pytest.approx(left)
    assert found.total == pytest.approx(np.hypot(*left.values()))


@pytest.mark.parametrize(
    ("parameters", "step", "orders_between"),
    [(("dt",), 0.01, (1.15, 2.0)), (("dt",), 0.02, (1.0, 2.0)), (("dt", "d_hat"), 0.02, (0.75, 1.8))],
)
def test_the_estimate_of_all_is_within_a_factor_of_two_for_a_range_of_orders(parameters, step, orders_between):
    for order in orders_between:
        coarse, fine = 1e-3, 1e-3 / 2**order
        assert 0.5 < from_all(coarse - fine, 2.0, parameters, step) / fine < 2


def test_errors_are_not_below_what_a_reference_solution_showed():
    errors = ParameterErrors({"dt": 0.5, "cells": 1.0}, {"dt": 3e-3, "cells": 4e-3})
    assert errors.not_below(1e-3) == errors
    assert errors.not_below(10e-3).errors == pytest.approx({"dt": 6e-3, "cells": 8e-3})


def test_expected_errors_fall_with_the_assumed_order():
    errors = ParameterErrors({"dt": 0.5}, {"dt": 8e-3})
    assert errors.at({"dt": 0.25}).errors["dt"] == pytest.approx(8e-3 / 2 ** orders({"dt"})["dt"])
    assert errors.expected_difference({"dt": 0.25}) == pytest.approx(8e-3 * (1 - 2 ** -orders({"dt"})["dt"]))


def test_a_difference_as_expected_changes_nothing():
    errors, finer = ParameterErrors({"dt": 0.5, "cells": 1.0}, {"dt": 8e-3, "cells": 1e-3}), {"dt": 0.25, "cells": 1.0}
    after = errors.after(finer, errors.expected_difference(finer))
    assert after.errors == pytest.approx(errors.at(finer).errors)
    assert after.calibration == pytest.approx(1.0)


def test_a_larger_difference_raises_what_was_refined_alone():
    errors, finer = ParameterErrors({"dt": 0.5, "cells": 1.0}, {"dt": 8e-3, "cells": 1e-3}), {"dt": 0.25, "cells": 1.0}
    after = errors.after(finer, 4 * errors.expected_difference(finer))
    assert after.errors["dt"] == pytest.approx(4 * errors.at(finer).errors["dt"])
    assert after.errors["cells"] == 1e-3
    assert not after.understood


def test_a_smaller_difference_lowers_the_largest_expectation_first():
    errors = ParameterErrors({"dt": 0.5, "d_hat": 1.0}, {"dt": 1e-3, "d_hat": 20e-3})
    finer = {"dt": 0.25, "d_hat": 0.5}
    expected = {name: errors.errors[name] - errors.at(finer).errors[name] for name in finer}
    after = errors.after(finer, 1.01 * expected["dt"])
    assert after.errors["d_hat"] == pytest.approx(LEAST_CALIBRATION * errors.at(finer).errors["d_hat"])
    assert after.errors["dt"] == pytest.approx(errors.at(finer).errors["dt"])
    assert after.understood
