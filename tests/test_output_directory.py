"""Output directories that are not empty, and runs with an intersecting start."""

import pytest
from small_scenes import BALL, RUN, SHEET, small_scene, without

from clothsim import InputError, IntersectionWarning, open_run, resume, simulate
from clothsim.base.record import RECORD_NAME, SUMMARY_NAME

SHORT = {**RUN, "duration": 0.04}


def test_a_run_that_cannot_be_resumed_keeps_its_summary(tmp_path):
    simulate(small_scene(effects={"inertia": {}, "gravity": {}}, run=SHORT), tmp_path)
    (tmp_path / RECORD_NAME).unlink()
    with pytest.raises(InputError, match=RECORD_NAME):
        resume(tmp_path)
    assert open_run(tmp_path).status == "completed"


def test_a_folder_in_place_of_the_summary_is_named(tmp_path):
    (tmp_path / SUMMARY_NAME).mkdir()
    with pytest.raises(InputError, match=SUMMARY_NAME):
        simulate(small_scene(effects={"inertia": {}}, run=SHORT), tmp_path)


def test_the_first_frame_is_checked_too(tmp_path):
    """A sheet that starts across the ball and has left it at the next frame."""
    sheet = {**SHEET, "position": [0, 0, 0.2], "velocity": [0, 0, 100]}
    with pytest.warns(IntersectionWarning, match="at the start"):
        run = simulate(small_scene(cloth=sheet, body=BALL, effects=without("body_contact"), run=SHORT), tmp_path)
    assert run.summary["certificate"]["intersecting_frames"] == [0]
    assert run.summary["certificate"]["intersection_free"] is False
