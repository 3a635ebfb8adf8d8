"""Recovery of bending and curl from outlines of drapes, against a tester of known law, and the command."""

import json

import numpy as np
import pytest

from clothsim import InputError
from clothsim.cli import main
from clothsim.study import drape_recovery
from clothsim.study.drape_recovery import GRAVITY, read_outlines, recover_drape


def laid(cloth, size):
    """Coefficients of three lays: .55 at a bending length of 17.5 mm, .17 a unit of log D, .01 for a curl of 1/m."""
    over_weight = np.sqrt(cloth["bending_warp"] * cloth["bending_weft"]) / (cloth["density"] * GRAVITY)
    mean = 0.55 + 0.17 * np.log(over_weight / 0.0175**3) + 0.01 * cloth.get("rest_curvature_warp", 0.0)
    return [mean - 0.005, mean, mean + 0.005]


BOTH = np.array([0.65, 0.59, 0.65, 0.59]), np.array([1.0, -1.0, 1.0, -1.0])


def test_both_sides_give_stiffness_and_curl():
    found = recover_drape(*BOTH, simulate=laid)
    assert found.bending_length**3 == pytest.approx(0.0175**3 * np.exp(0.07 / 0.17), rel=0.02)
    assert found.curl == pytest.approx(3.0, rel=0.05)
    assert 0.05 < found.relative_error < 0.3
    assert found.stiffnesses == {}


def test_one_side_gives_no_curl_and_a_weight_gives_stiffnesses():
    found = recover_drape(np.array([0.62]), np.ones(1), {"density": 0.15}, simulate=laid)
    assert found.curl is found.curl_error is None
    warp, weft, _ = (value for value, _ in found.stiffnesses.values())
    assert np.sqrt(warp * weft) == pytest.approx(0.15 * GRAVITY * found.bending_length**3, rel=1e-9)


def test_a_prior_tells_warp_and_weft_apart_within_its_own_spread():
    plain = recover_drape(*BOTH, {"density": 0.15}, simulate=laid)
    found = recover_drape(*BOTH, {"density": 0.15}, prior=True, simulate=laid)
    (warp, error), (weft, _), _ = found.stiffnesses.values()
    assert np.sqrt(warp * weft) == pytest.approx(0.15 * GRAVITY * plain.bending_length**3, rel=0.1)
    assert 0.3 < error < 0.98
    assert any("618" in note for note in found.notes)


def test_what_is_assumed_of_bending_is_told():
    assumed = recover_drape(*BOTH, simulate=laid).notes[0]
    ratio = " : ".join(str(part) for part in (drape_recovery.WARP, drape_recovery.WEFT, drape_recovery.BIAS))
    assert ratio in assumed
    assert "softening" in assumed


def test_a_cloth_beyond_the_tester_is_said():
    found = recover_drape(np.array([0.9]), np.ones(1), simulate=lambda cloth, size: [0.5, 0.5])
    assert any(note.startswith("NOT reached") for note in found.notes)


@pytest.mark.parametrize(
    "content",
    [{"r": np.ones(360)}, {"radii": np.full(360, 120.0)}, {"radii": np.ones(8) * 0.12}, {"radii": np.zeros((0, 360))}],
)
def test_a_file_without_an_outline_is_refused(tmp_path, content):
    np.savez(tmp_path / "outline.npz", **content)
    with pytest.raises(InputError):
        read_outlines(tmp_path / "outline.npz")


def test_sides_are_one_and_minus_one(tmp_path):
    np.savez(tmp_path / "outline.npz", radii=np.full((2, 360), 0.12), side=[0, 1])
    with pytest.raises(InputError, match="side"):
        read_outlines(tmp_path / "outline.npz")


def test_the_command_leaves_what_was_assumed(tmp_path, capsys, monkeypatch):
    class Laid:
        def __init__(self, value):
            self.shape = type("Shape", (), {"coefficient": value})

    monkeypatch.setattr(drape_recovery, "lays", lambda cloth, count, size: [Laid(value) for value in laid(cloth, size)])
    np.savez(tmp_path / "outline.npz", radii=np.full(360, 0.128))
    words = ["recover", "--test", "cusick", str(tmp_path / "outline.npz"), "--json", "-o", str(tmp_path / "out")]
    assert main(words) == 0
    document = json.loads(capsys.readouterr().out)
    assert document == json.loads((tmp_path / "out" / "recovery.json").read_text())
    assert document["coefficient"] == pytest.approx((0.128**2 - 0.09**2) / (0.15**2 - 0.09**2))
    assert len(document["notes"]) == 4
    assert main([*words[:4], "--prior"]) == 2
    assert main([*words[:4], "--set", "bending_warp=1e-5"]) == 2
    assert main([*words[:4], "--free", "density"]) == 2
    assert main(["recover", "sphere"]) == 2
