"""Frames of a predicted motion: certified, repaired or simulated, each free of intersections."""

import pytest
from moving_garments import moving_scene, skinned_model

from clothsim.engine import MovingGarment, checked_motion


@pytest.fixture(scope="module")
def garment():
    return MovingGarment.of_scene(moving_scene())


def test_what_does_not_intersect_is_certified(garment):
    [frame] = checked_motion(garment, skinned_model(garment), duration=0.0)
    assert (frame.verdict, frame.newton_iterations, frame.predicted.pairs) == ("certified", 0, 0)
    assert set(frame.seconds) == {"prediction", "test"}


def test_what_intersects_is_repaired(garment):
    first, *others = checked_motion(garment, skinned_model(garment, (0.0, 0.03, 0.0)))
    assert first.verdict == "simulated"  # before time 0 there is nothing to repair from
    assert [frame.verdict for frame in others] == ["repaired", "repaired"]
    for frame in (first, *others):
        assert frame.predicted.pairs > 0
        assert garment.checked(frame.cloth, frame.time).clean
        assert min(frame.seconds.values()) >= 0
    assert others[-1].newton_iterations > 0


def test_without_repair_it_is_simulated(garment):
    frames = list(checked_motion(garment, skinned_model(garment, (0.0, 0.03, 0.0)), duration=0.04, newton=0))
    assert [frame.verdict for frame in frames] == ["simulated", "simulated"]
    assert frames[1].newton_iterations > 0
    assert garment.checked(frames[1].cloth, 0.04).clean
