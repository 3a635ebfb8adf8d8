"""Log of iterates: a step from start to end, decreasing energy, separated retries."""

import numpy as np
import pytest
from small_scenes import SOLVER, small_scene

from clothsim import simulate
from clothsim.run import recorded_run as module
from clothsim.run.recorded_run import iterates_name

KEYS = {"dts", "solve", "positions", "fraction", "speed", "residual", "energy"}


def dumped(directory, step):
    with np.load(directory / iterates_name(step), allow_pickle=False) as archive:
        return {name: archive[name] for name in archive}


def test_they_lead_from_the_step_before_to_the_step(tmp_path):
    run = simulate(small_scene(), tmp_path, dump_iterates=5)
    found, entry = dumped(tmp_path, 5), run.record()[4]
    assert set(found) == KEYS
    assert found["dts"].tolist() == [entry["dt"]]
    assert len({len(found[name]) for name in KEYS - {"dts"}}) == 1
    assert len(found["fraction"]) == entry["newton_iterations"] + 1
    assert np.array_equal(found["positions"][0, :25], run.positions(2))  # frame 2 ends step 4
    assert found["fraction"][0] == 0
    assert np.isnan(found["speed"][0])
    assert (found["fraction"][1:] > 0).all()
    assert found["fraction"][-1] == 1
    assert found["speed"][-1] == entry["speed"] < 1e-3
    assert entry["residual"] < found["residual"][-1]  # after the last step, and where it began
    assert (np.diff(found["energy"]) <= 0).all()


def test_the_iterates_are_what_newton_did(tmp_path):
    """The last one is the state after the step: the start of the next."""
    simulate(small_scene(), tmp_path / "a", dump_iterates=5)
    simulate(small_scene(), tmp_path / "b", dump_iterates=6)
    end, start = dumped(tmp_path / "a", 5)["positions"][-1], dumped(tmp_path / "b", 6)["positions"][0]
    assert np.array_equal(end, start)
    steps = np.diff(dumped(tmp_path / "a", 5)["positions"], axis=0)
    found = dumped(tmp_path / "a", 5)
    moved = np.abs(steps).max(axis=(1, 2))
    assert moved == pytest.approx(found["fraction"][1:] * found["speed"][1:] * 0.02, rel=1e-6)


def test_watching_changes_no_bit_and_no_count(tmp_path):
    runs = [simulate(small_scene(), tmp_path / str(step), dump_iterates=step) for step in (None, 5)]
    assert np.array_equal(runs[0].positions(-1), runs[1].positions(-1))
    counts = [{name: e["evaluations"] for name, e in run.summary["effects"].items()} for run in runs]
    assert counts[0] == counts[1]
    assert not list((tmp_path / "None").glob("iterates_*"))


def test_each_try_of_a_step_is_a_solve_of_its_own(tmp_path):
    held = {"inertia": {}, "membrane": {}, "gravity": {}, "pins": {"select": "left"}}
    scene = small_scene(body=(), effects=held, solver=SOLVER | {"max_iterations": 1})
    run = simulate(scene, tmp_path, dump_iterates=1)
    found, entry = dumped(tmp_path, 1), run.record()[0]
    assert len(found["dts"]) == len(entry["failures"]) + 1 > 2
    assert found["dts"][-1] == entry["dt"]
    assert found["dts"][:-1] == pytest.approx(0.02 * 0.5 ** np.arange(len(entry["failures"])))
    assert found["solve"][0] == 0
    assert set(np.diff(found["solve"])) <= {0, 1}
    starts = np.flatnonzero(np.isnan(found["speed"]))
    assert (found["positions"][starts] == found["positions"][0]).all()


def test_what_does_not_fit_loses_its_beginning(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "MOST_BYTES", 2 * (25 + 42) * 24)
    simulate(small_scene(), tmp_path, dump_iterates=5)
    found = dumped(tmp_path, 5)
    assert len(found["positions"]) == 2
    assert found["fraction"][-1] == 1
