"""Animated motion between, before and after its frames."""

import numpy as np
import pytest

from clothsim.base.errors import InputError
from clothsim.mesh.body import frame_motion, make_body

RNG = np.random.default_rng(3)
FRAMES = RNG.standard_normal((4, 5, 3))
RATE = 25.0


@pytest.mark.parametrize("time", [0.0, 0.01, 0.04, 0.055, 0.08, 0.1199])
def test_between_frames_the_way_is_straight(time):
    moved = frame_motion(FRAMES, RATE).apply(FRAMES[0], time)
    expected = [[np.interp(time * RATE, range(4), FRAMES[:, i, k]) for k in range(3)] for i in range(5)]
    np.testing.assert_allclose(moved, expected, atol=1e-14)


def test_it_starts_at_the_first_frame_and_is_held_at_the_last():
    motion = frame_motion(FRAMES, RATE)
    assert np.array_equal(motion.apply(FRAMES[0], 0.0), FRAMES[0])
    for time in (motion.duration, 0.12, 0.2, 1e9):
        np.testing.assert_allclose(motion.apply(FRAMES[0], time), FRAMES[3], atol=1e-14)
    assert motion.duration == pytest.approx(0.12)
    assert not motion.still


@pytest.mark.parametrize("frames", [FRAMES[:1], FRAMES[[1, 1, 1]]], ids=["one frame", "all alike"])
def test_frames_that_do_not_differ_stand_still(frames):
    motion = frame_motion(frames, RATE)
    assert motion.still
    assert np.array_equal(motion.apply(frames[0], 0.3), frames[0])


@pytest.mark.parametrize(
    ("frames", "rate", "message"),
    [
        (FRAMES[0], RATE, r"shape \(5, 3\)"),
        (FRAMES[:0], RATE, "shape"),
        (np.where(np.arange(60).reshape(4, 5, 3) == 37, np.nan, FRAMES), RATE, "vertex 2 of frame 2"),
        (FRAMES, 0.0, "frames_per_second"),
    ],
)
def test_bad_frames_are_named(frames, rate, message):
    with pytest.raises(InputError, match=message):
        frame_motion(frames, rate)


def test_frames_of_another_body_are_refused():
    with pytest.raises(InputError, match=r"ball.* 3 .* 5"):
        make_body("ball", np.eye(3), np.array([[0, 1, 2]]), frame_motion(FRAMES, RATE))
