"""Catenary: a strip without bending between two level supports (docs/results/validation.md, A2)."""

import numpy as np
import pytest

from tests.known_answers.a2_catenary import SPAN, catenary, hanging


@pytest.mark.parametrize(
    ("ratio", "digits"),
    [(1.25, (0.33820188, 0.26543751, 55.9254)), (1.5, (0.20549098, 0.33508884, 67.6582))],
)
def test_catenary(ratio, digits):
    length = ratio * SPAN
    exact = catenary(length)
    assert exact == pytest.approx(digits, rel=1e-6)
    coarse, fine = (np.abs(hanging(length, cells) / exact - 1) for cells in (10, 20))
    assert (fine < 2e-3).all()
    assert (np.log2(coarse / fine) > 1.8).all()
