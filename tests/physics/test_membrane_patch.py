"""Patch test: an affine boundary makes an affine sheet, with slivers too (docs/results/validation.md, A1)."""

import pytest

from tests.known_answers.a1_membrane import STATES, patch


@pytest.mark.parametrize("F", STATES.values(), ids=STATES)
@pytest.mark.parametrize("seed", [0, 1])
def test_patch(F, seed):
    seen = patch(F, seed)
    assert seen.moved > 1e-3
    assert seen.distance < 1e-10
    assert seen.energy < 1e-12
    assert seen.force < 1e-10
