"""The truth beside a claim of solver.error: finer in all than what was chosen, and at a strict tolerance."""

import pytest

from tests.known_answers.honesty_table import STRICT, truth_of
from tests.known_answers.unseen_scenes import UNSEEN_SCENES


@pytest.mark.parametrize("levels", [1, 2])
def test_the_truth_is_finer_in_everything_than_what_was_chosen(levels):
    truth = truth_of(UNSEEN_SCENES["edge"], {"chosen": {"resolution": [8, "2", "1/2"]}}, levels)
    assert truth.solver["dt"] == pytest.approx(0.04 / 8 / 2**levels)
    assert tuple(truth.cloth["cells"]) == (24 * 2**levels, 12 * 2**levels)
    assert truth.effects["body_contact"]["d_hat"] == pytest.approx(1e-3 / 2**levels)
    assert truth.solver["tolerance"] == STRICT
