"""Limbs kept apart: arms out of the trunk by small turns, smooth in time, and nothing where nothing is near."""

from pathlib import Path

import numpy as np
import pytest

from clothsim.files.characters.character import mannequin_character
from clothsim.files.characters.clip import uniform_clip
from clothsim.files.characters.keep_apart import GAP, _least, kept_apart
from clothsim.files.characters.motion_check import meetings
from clothsim.keys.mesh_keys import check_body
from clothsim.scene.assembly.meshes import body_of


@pytest.fixture(scope="module")
def character():
    return mannequin_character()


def clip(character, joint, axis, degrees):
    """A swing of a joint there and back in .4 s, with few key times."""
    angles = np.radians(degrees) * np.sin(np.pi * np.linspace(0, 1, 9))
    poses = [character.skeleton.turned({joint: a * np.asarray(axis, float)}) for a in angles]
    root = np.tile(character.skeleton.rest.translations[0], (9, 1))
    return uniform_clip("swing", character.skeleton, 20.0, np.array([pose.rotations for pose in poses]), root)


def deepest(character, motion, times):
    found = meetings(character, motion.pose, times, 0.0)
    return min((met.nearest for met in found), default=0.0)


TIMES = [0.0, 0.2]


@pytest.mark.parametrize(("joint", "axis", "degrees"), [("left_shoulder", (0, 1, 0), 40), ("left_hip", (0, 1, 0), 14)])
def test_limbs_in_other_parts_come_out(character, joint, axis, degrees):
    given = clip(character, joint, axis, degrees)
    assert deepest(character, given, TIMES) < -0.005
    apart = kept_apart(character, given, character.skeleton.rest, (0.0, given.duration), False)
    assert deepest(character, apart, TIMES) == 0.0
    assert apart.duration == given.duration
    assert 0 < apart.largest.max() < np.radians(degrees) / 1.8


def test_a_motion_without_meetings_stays(character):
    given = clip(character, "left_shoulder", (1, 0, 0), 10)
    apart = kept_apart(character, given, character.skeleton.rest, (0.0, 0.1), True)
    assert apart.largest.max() == 0.0
    for time in (0.0, 0.07):
        np.testing.assert_allclose(apart.pose(time).rotations, given.pose(time).rotations, rtol=0, atol=1e-15)


def test_the_key_of_a_scene():
    motion = {"clip": "turn", "end": 0.02, "keep_apart": True, "lead_in": 0.1}
    _, notes = body_of(check_body("body", {"model": "mannequin", "motion": motion}), "body", Path())
    assert any("degrees to keep apart" in note for note in notes)
    assert 0 < GAP < 0.05


def test_the_least_vector_of_inequalities():
    np.testing.assert_allclose(_least(np.array([[1.0, 1.0]]), np.array([2.0])), (1, 1), atol=1e-12)
    np.testing.assert_allclose(_least(np.eye(2), np.array([1.0, -3.0])), (1, 0), atol=1e-12)
    assert not _least(np.eye(2), np.array([-1.0, -3.0])).any()
    opposed = _least(np.array([[1.0, 0], [-1.0, 0]]), np.array([1.0, 1.0]))
    assert np.abs(opposed).max() < 1e-9
