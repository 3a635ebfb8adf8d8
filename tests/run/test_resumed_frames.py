"""Checkpoints made by hand or by another version: frames that are not due, plastic strains of other points."""

from dataclasses import replace

import numpy as np
import pytest
from small_scenes import EFFECTS, small_scene

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


@pytest.mark.parametrize("strains", [np.zeros(6), [[1.0], 2.0], "none", {}], ids=["few", "ragged", "text", "table"])
def test_plastic_strains_of_other_points_are_refused(tmp_path, strains):
    """Before each triangle had three points a checkpoint held a third of the strains: "a fault of clothsim"."""
    effects = EFFECTS | {"bending": {"short_waves": 1.0}, "plastic_bending": {"yield_curvature": 1.0}, "friction": {}}
    clothsim.simulate(small_scene(effects=effects), tmp_path)
    saved = read_checkpoint(tmp_path / CHECKPOINT_NAME)
    assert {"plastic_bending", "friction", "body_contact"} <= saved.state.memory.keys()
    assert clothsim.resume(tmp_path).status == "completed"
    memory = {**saved.state.memory, "plastic_bending": strains}
    write_checkpoint(tmp_path / CHECKPOINT_NAME, replace(saved, state=replace(saved.state, memory=memory)))
    with pytest.raises(InputError, match=r"effects\.plastic_bending"):
        clothsim.resume(tmp_path)
