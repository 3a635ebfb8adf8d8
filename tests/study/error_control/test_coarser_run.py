"""Error estimate by a coarser run: not known where that ends in another shape."""

from dataclasses import replace

import pytest

from clothsim import simulate
from clothsim.study.error_control import resolution
from tests.known_answers.error_scenes import ERROR_SCENES


@pytest.mark.parametrize(("fraction", "known"), [(1e-9, False), (10.0, True)])
def test_a_coarser_run_of_another_shape_says_nothing_of_the_error(fraction, known, monkeypatch):
    monkeypatch.setattr(resolution, "ANOTHER_SHAPE", fraction)
    scene = ERROR_SCENES["twisted"]
    run = simulate(replace(scene, solver={**scene.solver, "estimate": True}))
    estimate = run.summary["certificate"]["error_estimate"]
    assert estimate["known"] is known
    assert ("coarser runs" in estimate["fixed"]) is not known
    assert estimate["total"] > 0
