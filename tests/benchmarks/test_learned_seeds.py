"""Ratios of drapes from learned seeds and transferred ones."""

import numpy as np
import pytest

from tests.benchmarks.learned_seeds import Row, as_text, ratios


def row(drape, start, iterations, cause="", seconds=1.0):
    return Row(drape, start, cause, iterations, seconds, 0.01, np.nan if cause else 0.002)


def test_ratios_are_of_drapes_that_are_usable_from_both_starts():
    rows = [
        row("a", "transfer", 100), row("a", "model", 50, seconds=0.5),
        row("b", "transfer", 100), row("b", "model", 90),
        row("c", "transfer", 100, "not at rest"), row("c", "model", 10),
        row("d", "transfer", 100), row("d", "model", 10, "not certified"),
    ]  # fmt: skip
    found = ratios(rows, "model", "transfer")
    assert found["drapes"] == 2
    assert found["newton"] == pytest.approx(0.7)
    assert (found["newton_least"], found["newton_median"], found["newton_most"]) == pytest.approx((0.5, 0.7, 0.9))
    assert found["cpu"] == pytest.approx(0.75)
    assert len(as_text(rows).splitlines()) == len(rows) + 2
