"""The small form of the list, in this process; and that the check and the oracle see what is wrong."""

import numpy as np
import pytest
import trimesh

from tests.hostile import meshes, motions, scenes, sewing, words
from tests.hostile.case import Case, checked
from tests.hostile.drawn import as_toml, drawn, drawn_cases
from tests.hostile.harness import run_here
from tests.hostile.oracle import crossing_pairs, last_frame

SMALL = [case for room in (meshes, motions, sewing, scenes, words) for case in room.cases() if case.small]
DRAWN = drawn_cases(4, 0)


@pytest.mark.parametrize("case", [*SMALL, *DRAWN], ids=lambda case: case.name)
def test_it_gets_its_class(case, tmp_path, monkeypatch):
    monkeypatch.setenv("CLOTHSIM_RENDERER", "ray")
    outcome = run_here(case, tmp_path)
    assert outcome.wrong == "", outcome.text[-2000:]


def test_the_small_form_has_some_of_every_room():
    assert len(SMALL) >= 20
    assert {case.name.partition(":")[0] for case in SMALL} >= {"mesh", "motion", "pattern", "scene", "value", "words"}


@pytest.mark.parametrize(
    ("code", "text", "got"),
    [
        (2, "a sentence", "refused"),
        (1, "found", "found"),
        (1, "Traceback (most recent call last):", "fell"),
        (1, "This is a fault of clothsim; --debug shows where.", "fell"),
        (-11, "", "fell"),
        (None, "", "hung"),
    ],
)
def test_the_check(tmp_path, code, text, got):
    case = Case("x", "x", "refused")
    outcome = checked(case, tmp_path, code, text, (1.0, 1.0, 1e8))
    assert outcome.got == got
    assert bool(outcome.wrong) == (got != "refused")
    assert checked(case, tmp_path, 2, text, (1.0, 11.0, 1e8)).wrong
    assert checked(case, tmp_path, 2, text, (1.0, 1.0, 3e9)).wrong


def test_the_oracle_counts_what_crosses():
    """Two boxes: apart, through one another, and one inside the other, where no surfaces cross."""
    box = trimesh.creation.box()
    for shift, scale, cross in ((2.0, 1.0, False), (0.5, 0.9, True), (0.0, 0.5, False)):
        points = np.concatenate([box.vertices, scale * box.vertices + [shift, 0.03, 0.02]])
        triangles = np.concatenate([box.faces, box.faces + len(box.vertices)])
        owner = np.repeat([0, 1], len(box.faces))
        assert (crossing_pairs(points, triangles, owner, {1}) > 0) == cross
        assert crossing_pairs(points, triangles, owner, {0, 1}) == 0


def test_the_oracle_reads_the_last_frame(tmp_path):
    case = Case("as it is", scenes.RUN, "completed", {"a.toml": scenes.SHEET})
    assert run_here(case, tmp_path).wrong == ""
    points, triangles, owner = last_frame(tmp_path / "out/trajectory.vtkhdf")
    assert len(points) == 25 + 42
    assert [int((owner == k).sum()) for k in (0, 1)] == [32, 80]
    assert triangles.max() == len(points) - 1
    assert points[:25, 2].min() > 0.3


def test_drawn_scenes_depend_on_their_seed_alone():
    first, again, other = (as_toml(drawn(np.random.default_rng([seed, 5]))) for seed in (1, 1, 2))
    assert first == again != other
