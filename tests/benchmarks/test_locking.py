"""Membrane locking: its table, and the gain of pairs on an unfavourable mesh."""

import json

import pytest

from clothsim.mesh.world import make_world
from tests.benchmarks import locking
from tests.known_answers.unit_meshes import cloth, grid


def test_pairs_win_across_the_diagonals(monkeypatch):
    monkeypatch.setattr(locking, "MESHES", {"across": ("right", -1.0)})
    monkeypatch.setattr(locking, "FINE", 20)
    locking.reference.cache_clear()
    try:
        triangles, pairs = locking.wrinkles((10,), ("none", "pairs"))
    finally:
        locking.reference.cache_clear()
    assert triangles.what == "4 cells a wrinkle"
    assert triangles.errors[0] > 0.7
    assert abs(pairs.errors[0]) < 0.3


def test_the_table_has_every_case_and_is_kept(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(locking, "wrinkles", lambda: iter([]))
    balloons = locking.balloons
    monkeypatch.setattr(locking, "balloons", lambda: balloons((6,)))
    assert locking.main(["--json", str(tmp_path / "locking.json")]) == 0
    output = capsys.readouterr().out
    rows = json.loads((tmp_path / "locking.json").read_text())
    assert [row["remedy"] for row in rows] == list(locking.REMEDIES)
    assert all(remedy in output for remedy in locking.REMEDIES)
    assert rows[0]["errors"][1] == pytest.approx(-0.285, abs=0.005)


def test_softer_is_softer():
    world = make_world([cloth(*grid(2, 2))])
    x = 1.1 * world.start()
    hard = locking.REMEDIES["none"](world).value(x)
    assert locking.softer(world).value(x) == pytest.approx(0.1 * hard)
