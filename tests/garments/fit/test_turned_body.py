"""A whole fit on a turned body is the fit on the body as it was, turned alike: any heading, z up or y up."""

from dataclasses import replace

import numpy as np
import pytest

import clothsim
from clothsim.garments import stages
from clothsim.garments.fit import pipeline as module
from clothsim.garments.inputs import BodyMesh
from clothsim.mesh.body import rotation_matrix
from clothsim.mesh.generators.table import GENERATORS
from transfer.body_frame import body_frame

MANNEQUIN = BodyMesh("mannequin", *GENERATORS["mannequin"](), 1.0, ())
LARGE = GENERATORS["mannequin"](height=1.82, chest=1.15, waist=1.2, hips=1.12)
SKIRT = GENERATORS["skirt"](edge=0.04)
SHIFT = np.array([0.3, -0.2, 0.1])
Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
HALF, QUARTER = (rotation_matrix(np.array([0.0, 0.0, angle])) for angle in (np.pi, np.pi / 2.0))


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    """The skirt of the mannequin on the large one turned by R, and moved."""

    def on_turned(R, shift):
        return clothsim.fit(
            clothsim.Cloth(*SKIRT),
            clothsim.Body(LARGE[0] @ R.T + shift, LARGE[1]),
            clothsim.Body(MANNEQUIN.positions, MANNEQUIN.triangles),
            tmp_path_factory.mktemp("fit") / "out",
        )

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "FALLING", 10.0)
        run = {"duration": 0.1, "frames_per_second": 10}
        patch.setattr(stages, "FIT_DRAPE", replace(stages.FIT_DRAPE, run=run))
        yield on_turned, on_turned(np.eye(3), np.zeros(3))


@pytest.mark.parametrize("turn", [HALF, QUARTER, Y_UP @ QUARTER], ids=["half", "quarter", "y_up_quarter"])
def test_a_fit_on_a_turned_body_is_the_fit_turned_alike(fitted, turn):
    on_turned, straight = fitted
    done = on_turned(turn, SHIFT)
    assert (done.status, done.size.kind) == (straight.status, "graded") == ("completed", "graded")
    assert [stage.name for stage in done.stages] == [stage.name for stage in straight.stages]
    back = (done.positions - SHIFT) @ turn
    assert np.abs(back - straight.positions).max() < 5e-3
    for name in ("edge_low", "edge_high", "scale", "hem", "front"):
        assert getattr(done.look, name) == pytest.approx(getattr(straight.look, name), abs=2e-3), name
    assert done.size.factors == pytest.approx(straight.size.factors, rel=1e-3)
    frames = [body_frame(*LARGE), body_frame(LARGE[0] @ turn.T + SHIFT, LARGE[1])]
    np.testing.assert_allclose(frames[1].front, turn @ frames[0].front, atol=1e-3)
