"""Certificate of a run: steps checked by the exact intersection test, independent of contact."""

import numpy as np
import pytest
from small_scenes import EFFECTS, small_scene, without

from clothsim import IntersectionWarning, simulate
from clothsim.geometry.intersection.crossings import Crossing
from clothsim.run.intersections import IntersectionCheck

SHORT = {"duration": 0.08, "frames_per_second": 25}
FOUND = {
    role: (Crossing("cloth", other, role, np.array([[3, 17]]), np.array([0.1, 0.2, 0.3])),)
    for role, other in (("body", "ball"), ("cloth", "cloth"))
}


def run_that_meets(monkeypatch, folder, role, effects):
    """A run in which the check finds a crossing of `role` in the third step (between two frames) and later."""
    checked = []

    def crossings(self, x, origin=None):
        checked.append(x)
        return FOUND[role] if len(checked) > 3 else ()

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
    assert run.reason == f"At 0.06 s: {sentence}."
    assert run.summary["failure"]["cause"] == "intersection"
    assert run.summary["failure"]["position"] == [0.1, 0.2, 0.3]
    assert run.summary["certificate"]["intersecting_frames"] == []
    assert run.intersection_free is False
    crossed = run.intersections[f"cloth_{role}"]
    assert (crossed["states"], crossed["first_step"], crossed["first_frame"]) == (1, 3, None)
    assert run.summary["warnings"] == []
    assert len(run.times) == 2


def test_a_run_goes_on_where_nothing_was_promised(monkeypatch, tmp_path):
    with pytest.warns(IntersectionWarning, match="body_contact"):
        run = run_that_meets(monkeypatch, tmp_path, "body", without("body_contact"))
    assert run.status == "completed"
    assert run.summary["certificate"]["intersecting_frames"] == [2]
    crossed = run.intersections["cloth_body"]
    counts = ("pairs", "states", "first_step", "first_time", "first_frame")
    assert [crossed[key] for key in counts] == [1, 2, 3, 0.06, 2]
    assert len(run.summary["warnings"]) == 1


def test_the_certificate_names_the_checks_whatever_effects_are_on(tmp_path):
    keys = ("cloth_body", "cloth_cloth")
    both = simulate(small_scene(effects=EFFECTS | {"self_contact": {}}, run=SHORT), tmp_path / "both")
    assert both.status == "completed", both.reason
    body = simulate(small_scene(run=SHORT), tmp_path / "body")
    certificates = [run.summary["certificate"] for run in (both, body)]
    assert len({certificate[key] for certificate in certificates for key in keys}) == 1
    assert [run.intersection_free for run in (both, body)] == [True, True]
