"""Clips of the package: drawn from their names, from standing to standing, on the ground but for the jump's flight."""

from functools import cache

import numpy as np
import pytest

from clothsim.files.characters.gait import KINDS, SECONDS, is_packaged, packaged_clip, standing_pose

drawn = cache(packaged_clip)


def ankles(clip, time):
    names = clip.skeleton.names
    rows = [names.index(f"{side}_ankle") for side in ("left", "right")]
    return clip.skeleton.transforms(clip.pose(time))[rows, 2, 3]


@pytest.mark.parametrize("kind", KINDS)
def test_a_drawn_clip_is_its_name(kind):
    one, other = drawn(f"{kind}:1"), drawn(f"{kind}:2")
    again = packaged_clip.__wrapped__(f"{kind}:1")  # drawn once more
    assert np.array_equal(one.tracks[0].values, again.tracks[0].values)
    assert one.duration != other.duration
    assert SECONDS[0] - 0.02 <= one.duration <= SECONDS[1] + 0.02


@pytest.mark.parametrize("kind", KINDS)
def test_the_lower_foot_stays_on_the_ground(kind):
    clip = drawn(f"{kind}:1")
    heights = [ankles(clip, time).min() for time in clip.tracks[0].times]
    if kind == "jump":
        assert 0.05 < max(heights) - heights[0] < 0.17
    else:
        assert np.ptp(heights) < 1e-9


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind not in ("gait", "turn")])
def test_it_begins_and_ends_in_standing(kind):
    clip = drawn(f"{kind}:2")
    still = standing_pose(clip.skeleton).rotations
    for time in (0.0, clip.duration):
        assert np.abs(np.abs((clip.pose(time).rotations * still).sum(axis=1)) - 1).max() < 1e-9
    assert np.abs(clip.pose(clip.duration / 2).rotations - still).max() > 0.02 or kind == "jump"


@pytest.mark.parametrize("name", ["jump", "jump:", "jump:-1", "dance:1", "jump:1.5", "own"])
def test_other_names_are_no_clips(name):
    assert not is_packaged(name)
