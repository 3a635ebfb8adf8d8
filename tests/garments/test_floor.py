"""Floors of noise: twins of a run, their file, and scenes of arrays that are the same run."""

import json

import numpy as np
import pytest
from small_scenes import EFFECTS, RUN, small_scene

from clothsim import open_run, simulate
from clothsim.garments.floor import ASIDE, FLOOR_NAME, Floor, aside, floor_of, scene_of_arrays, stricter


@pytest.fixture
def run(tmp_path):
    scene = small_scene(effects=EFFECTS | {"pins": {"select": "left"}}, run=RUN)
    return simulate(scene, tmp_path / "run")


def test_a_scene_of_arrays_is_the_same_run(run):
    again = simulate(scene_of_arrays(run.scene))
    np.testing.assert_array_equal(again.positions(-1), run.positions(-1))


def test_the_twin_starts_aside_with_the_same_rest_shape(run):
    cloth = aside(run.scene).cloths[0].mesh
    moved = np.abs(cloth.vertices - run.positions(0))
    assert 0.3 * ASIDE < moved.mean() < 3 * ASIDE
    assert np.abs(cloth.rest - run.positions(0)).max() != pytest.approx(0.0, abs=1e-9)  # its own axes, not placed


def test_the_stop_is_a_tenth_of_that_given_or_of_the_usual_one():
    assert stricter(small_scene(solver={"tolerance": 1e-3})).solver_settings.tolerance == pytest.approx(1e-4)
    usual = small_scene()
    assert stricter(usual).solver_settings.stop_fraction == pytest.approx(0.1 * usual.solver_settings.stop_fraction)


def test_a_floor_is_found_once_for_a_run(run, monkeypatch):
    found = floor_of(run)
    assert found.start.shape == found.stop.shape == (len(run),)
    assert 0 < found.start[-1] < 1e-8
    assert found.start[0] == pytest.approx(3 * ASIDE**2, rel=0.5)
    assert found.stop[0] == 0
    start, _ = found.rms({1, 2, 3})
    assert start == pytest.approx(np.sqrt(found.start[4:].mean()))
    monkeypatch.setattr("clothsim.garments.floor.clothsim.simulate", None)  # no run is taken
    again = floor_of(open_run(run.directory))
    np.testing.assert_array_equal(again.start, found.start)


def test_a_file_of_another_run_is_not_taken(run):
    content = {"run": "another", "start": [0.0] * len(run), "stop": [0.0] * len(run)}
    (run.directory / FLOOR_NAME).write_text(json.dumps(content))
    assert floor_of(run).start[-1] > 0
    (run.directory / FLOOR_NAME).write_text("nothing")
    assert floor_of(run).start[-1] > 0


def test_without_other_frames_nothing_is_known(run):
    assert np.isnan(floor_of(run).rms(range(len(run)))).all()


def test_the_floor_of_a_frame_is_that_of_the_farther_twin():
    found = Floor(np.array([0.0, 4e-6, 9e-6, np.nan]), np.array([0.0, 1e-6, 16e-6, np.nan]))
    np.testing.assert_allclose(found.at([1, 2, 3]), [2e-3, 4e-3, 0.0])
