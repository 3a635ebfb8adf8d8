"""Checkpoints made by hand: frames that are not due."""

from dataclasses import replace

import pytest
from small_scenes import small_scene

import clothsim
from clothsim import InputError
from clothsim.files.runs.checkpoint import CHECKPOINT_NAME, read_checkpoint, write_checkpoint


def test_frames_that_are_not_due_do_not_complete_a_run(tmp_path):
    """Frame 999 of a run of four ended it at once as completed."""
    clothsim.simulate(small_scene(), tmp_path / "out")
    file = tmp_path / "out" / CHECKPOINT_NAME
    saved = read_checkpoint(file)
    assert clothsim.resume(tmp_path / "out").status == "completed"
    write_checkpoint(file, replace(saved, state=replace(saved.state, frame=999)))
    with pytest.raises(InputError, match="999"):
        clothsim.resume(tmp_path / "out")
