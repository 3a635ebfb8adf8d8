"""Page of a garment in motion: each frame in the colour of its verdict, faults told."""

from dataclasses import replace

import numpy as np
import pytest
from moving_garments import moving_scene, skinned_model

from clothsim import InputError
from clothsim.base.arrays import write_arrays
from clothsim.engine import MovingGarment
from clothsim.run.checked_motion import CheckedFrame


def frames_of(garment):
    for k, verdict in enumerate(("certified", "repaired", "simulated")):
        found = garment.checked(garment.start + np.array([2.0 * k, 0.0, k]), 0.04 * k)
        yield CheckedFrame(0.04 * k, verdict, found.cloth, found.bodies, found, {"test": 0.01})
    raise InputError("It stops here.")


def test_the_figure_moves_with_its_verdicts(tmp_path, monkeypatch):
    pytest.importorskip("viser")
    from clothsim.viewer import preview

    garment = MovingGarment.of_scene(moving_scene())
    file = write_arrays(tmp_path / "model.npz", skinned_model(garment).arrays())
    monkeypatch.setattr(preview, "checked_motion", lambda garment, _: frames_of(garment))
    page = preview.preview_motion(garment.scene, file, port=18_785)
    try:
        page.controls["play"].value = False
        while not page.fault:
            assert len(page.frames) <= 3
        assert [page.show(k).verdict for k in range(3)] == list(preview.COLOURS)
        [cloth] = page.nodes["cloths"]
        assert tuple(cloth.color) == preview.DRAPED
        assert np.allclose(cloth.vertices, garment.start + np.array([0, 0, 2]), atol=1e-5)  # the view follows it
        [body], [seen] = page.frames[2].bodies, page.nodes["bodies"]
        assert np.allclose(seen.vertices, body - [4.0, 0.0, 0.0], atol=1e-5)  # and its body with it
        assert "1 certified, 1 repaired, 1 simulated" in page.counts_text()
        assert "stops" in page.counts_text()
    finally:
        page.close()


def test_a_model_of_another_garment_is_no_preview(tmp_path):
    pytest.importorskip("viser")
    from clothsim.viewer.preview import preview_motion

    garment = MovingGarment.of_scene(moving_scene())
    file = write_arrays(tmp_path / "model.npz", replace(skinned_model(garment), family="other").arrays())
    with pytest.raises(InputError, match="another garment"):
        preview_motion(garment.scene, file, port=18_786)
