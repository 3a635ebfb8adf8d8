"""Benchmark of the round trip: rows of a run's frames, the draws and the text."""

from collections import Counter

import numpy as np
import pytest

import clothsim
from tests.benchmarks.canonical_round_trip import EASES, Row, as_text, drawn_scene, in_all, main, rows_of

SCENE = clothsim.Scene(
    cloth={"name": "skirt", "mesh": "skirt", "edge": 0.04},
    body={"model": "mannequin", "motion": {"clip": "turn", "lead_in": 0.1}},
    effects={"membrane": {}},
    run={"duration": 0.04},
)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return clothsim.simulate(SCENE, tmp_path_factory.mktemp("run") / "turn")


def test_frames_of_a_run_are_rows(run):
    (row,) = rows_of(run, SCENE, [1], "turn")
    assert row.vertices == len(run[1].positions["skirt"])
    assert row.fixed < 1e-9
    assert row.within == 1 - row.missed / row.vertices
    assert sum(row.joints.values()) == row.missed
    assert (row.worst <= 1e-3) == (row.missed == 0)


def test_the_command_counts_frames(run, capsys):
    assert main(["--drapes", "0", "--run", str(run.directory), "--frames", "2"]) == 0
    assert len(capsys.readouterr().out.splitlines()) == 2 + len(run.times) - 1 + 1
    assert main(["--drapes", "0"]) == 1


def test_the_text_has_the_rows_and_what_they_have_together():
    rows = [Row("a", 90, 1e-12, 1.0, 0, 1e-8, Counter()), Row("b", 10, 2e-12, 0.5, 5, 0.02, Counter({"x and y": 5}))]
    assert len(as_text(rows).splitlines()) == 4
    assert "95.000 %" in in_all(rows)


def test_draws_depend_on_the_seed_alone():
    (one, first), (same, second), (other, _) = (drawn_scene(np.random.default_rng(seed)) for seed in (3, 3, 4))
    assert one == same != other
    assert first == second
    assert one.split(",")[0] in EASES
