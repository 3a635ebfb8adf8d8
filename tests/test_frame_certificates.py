"""Certificate of a run: frames checked by the exact intersection test, independent of contact."""

import subprocess
import sys

import numpy as np
import pytest
from small_scenes import EFFECTS, SHEET, small_scene, without

from clothsim import simulate
from clothsim.intersection.crossings import Crossing
from clothsim.sim.intersection_check import IntersectionCheck

SHORT = {"duration": 0.08, "frames_per_second": 25}
FOUND = {
    role: (Crossing("cloth", other, role, np.array([[3, 17]]), np.array([0.1, 0.2, 0.3])),)
    for role, other in (("body", "ball"), ("cloth", "cloth"))
}


def run_that_meets(monkeypatch, folder, role, effects):
    """A run in which the judge finds a crossing of `role` in the second frame and later."""
    judged = []

    def crossings(self, x, cloth_cloth=None, limit=1):
        judged.append(x)
        return FOUND[role] if len(judged) > 1 else ()

    monkeypatch.setattr(IntersectionCheck, "crossings", crossings)
    return simulate(small_scene(effects=effects, run=SHORT), folder)


@pytest.mark.parametrize(
    ("role", "effect", "sentence"),
    [
        ("body", "body_contact", "triangle 3 of cloth intersects triangle 17 of ball near (0.1, 0.2, 0.3) m"),
        ("cloth", "self_contact", "triangles 3 and 17 of cloth intersect near (0.1, 0.2, 0.3) m"),
    ],
)
def test_a_run_ends_with_the_place_where_contact_failed(monkeypatch, tmp_path, role, effect, sentence):
    run = run_that_meets(monkeypatch, tmp_path, role, EFFECTS | {effect: {}})
    assert run.status == "failed"
    assert run.reason == f"At 0.04 s: {sentence}."
    assert run.summary["failure"]["cause"] == "intersection"
    assert run.summary["failure"]["position"] == [0.1, 0.2, 0.3]
    assert run.summary["certificate"]["intersecting_frames"] == [1]
    assert run.summary["certificate"]["intersection_free"] is False
    assert len(run.times) == 2


def test_a_run_goes_on_where_nothing_was_promised(monkeypatch, tmp_path):
    run = run_that_meets(monkeypatch, tmp_path, "body", without("body_contact"))
    assert run.status == "completed"
    assert run.summary["certificate"]["intersecting_frames"] == [1, 2]


def test_the_certificate_names_the_checks(tmp_path):
    tested = "tested at every frame"
    output = simulate(small_scene(effects=EFFECTS | {"self_contact": {}}, run=SHORT), tmp_path / "both")
    assert output.status == "completed", output.reason
    assert [output.summary["certificate"][key] for key in ("cloth_body", "cloth_cloth")] == [tested, tested]
    output = simulate(small_scene(run=SHORT), tmp_path / "body")
    assert [output.summary["certificate"][key] for key in ("cloth_body", "cloth_cloth")] == [tested, "not requested"]


def test_where_nothing_is_checked_the_test_is_not_even_imported(tmp_path):
    code = f"""
import sys, clothsim
scene = clothsim.Scene(cloth={SHEET!r}, effects={{"inertia": {{}}, "gravity": {{}}}}, run={{"duration": 0.02}})
clothsim.simulate(scene, {str(tmp_path)!r})
print([name for name in sys.modules if name.startswith("clothsim.intersection")])
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stdout.strip() == "[]", done.stderr
