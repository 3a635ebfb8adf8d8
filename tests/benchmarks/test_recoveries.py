"""The table of recoveries: errors in the unit of the number beside their distance from the truth."""

import numpy as np
import pytest

from tests.benchmarks.recoveries import CASES, NOISE, row


def test_a_stated_error_is_relative_and_its_row_in_the_unit_of_the_number():
    """Errors of .05 % of 0.3 m are 0.15 mm, and the two values 0.15 mm off are one error off."""
    path, true, rms, most, stated, ratio, largest = row("width", 0.3, [0.30015, 0.29985], [5e-4, 5e-4])
    assert (path, true, rms, most) == ("width", "0.3", "0.00015", "0.00015")
    assert [float(each) for each in stated.split(" to ")] == pytest.approx([1.5e-4, 1.5e-4], rel=0.01)
    assert (float(ratio), float(largest)) == (1.0, 1.0)


@pytest.mark.parametrize("name", CASES)
def test_the_target_of_a_case_is_off_its_first_guess(name):
    case = CASES[name]()
    drape = case.drape()
    first = type(case)(case.scene, {}, None).drape()
    assert drape.shape == first.shape
    assert np.abs(drape - first).max() > 10 * NOISE
