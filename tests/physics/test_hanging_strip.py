"""Drop of the lower end of a strip under its own weight, free to narrow (docs/results/validation.md, A1)."""

import numpy as np
import pytest

from tests.known_answers.a1_membrane import drop, simulated_drop


@pytest.mark.parametrize(("weight", "digits"), [(0.5, 0.09683185), (1.0, 0.21438245)])
def test_hanging_strip(weight, digits):
    exact = drop(weight)
    assert exact == pytest.approx(digits, abs=6e-9)
    errors = np.array([simulated_drop(weight, cells) - exact for cells in (8, 16, 32)])
    assert abs(errors[-1]) < 1e-3 * exact
    assert np.log2(abs(errors[-2] / errors[-1])) > 1.8
