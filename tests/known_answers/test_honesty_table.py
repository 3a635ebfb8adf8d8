"""The truth beside a claim of solver.error: finer by two in all than what was chosen, and at a strict tolerance."""

import pytest

from tests.known_answers.honesty_table import STRICT, truth_of
from tests.known_answers.unseen_scenes import UNSEEN_SCENES


def test_the_truth_is_finer_by_two_in_everything_than_what_was_chosen():
    truth = truth_of(UNSEEN_SCENES["edge"], {"chosen": {"resolution": [8, "2", "1/2"]}})
    assert truth.solver["dt"] == pytest.approx(0.04 / 16)
    assert tuple(truth.cloth["cells"]) == (48, 24)
    assert truth.effects["body_contact"]["d_hat"] == pytest.approx(2e-3 / 4)
    assert truth.solver["tolerance"] == STRICT
