"""Authored clips: offsets over time and space, the guided run with its verdict, and bad keys."""

import json

import numpy as np
import pytest
from small_scenes import EFFECTS, small_scene

import clothsim
from clothsim import InputError, author, files, open_run, simulate
from clothsim.garments.author import AUTHORED_NAME, TARGETS_NAME, edited_frames, targets
from clothsim.gradients.clips.numbers import clip_numbers

ON = EFFECTS | {"self_contact": {}}


@pytest.fixture(scope="module")
def sheet(tmp_path_factory):
    """A sheet that falls on a ball, 9 frames."""
    run = {"duration": 0.32, "frames_per_second": 25}
    return simulate(small_scene(effects=ON, run=run), tmp_path_factory.mktemp("author") / "sheet")


def lifted(run, frame, by=0.05):
    x = run.positions(frame).copy()
    x[-1, 2] += by
    return x


def test_offsets_are_linear_between_keys_held_beyond_and_none_at_the_start(sheet):
    keys = edited_frames(sheet, {6: lifted(sheet, 6, 0.04), 2: lifted(sheet, 2, 0.02)})
    assert [key.frame for key in keys] == [2, 6]
    made = targets(sheet, keys, "world")
    moved = made - np.array([frame.positions["cloth"] for frame in sheet])
    np.testing.assert_allclose(moved[:, -1, 2], [0, 0.01, 0.02, 0.025, 0.03, 0.035, 0.04, 0.04, 0.04], atol=1e-12)
    assert not np.abs(moved[:, :-1]).any()


def test_a_clip_passes_by_its_key_and_is_free_of_intersections(sheet, tmp_path):
    found = author(sheet, {5: lifted(sheet, 5)}, tmp_path / "clip", quick=True)
    (key,) = found.keys
    assert found.run.status == "completed"
    assert len(found.run) == len(sheet)
    assert found.intersecting_frames == ()
    assert key.before_most == pytest.approx(0.05)
    assert key.after < 0.3 * key.before
    written = json.loads((tmp_path / "clip" / AUTHORED_NAME).read_text())
    assert written == found.as_json()
    assert np.load(tmp_path / "clip" / TARGETS_NAME).shape == (9, 25, 3)
    again = open_run(tmp_path / "clip")  # what other commands need: a scene that is built again
    assert again.field("stress").shape == (32, 3, 2)


def test_without_an_offset_the_clip_is_the_run(tmp_path):
    """A frame a step. Where the cloth touches, the pull counts among the loads for which contact is stiff enough."""
    settings = {"duration": 0.32, "frames_per_second": 50}
    effects = ON | {"body_contact": {"d_hat": 0.01}}
    run = simulate(small_scene(effects=effects, run=settings), tmp_path / "run")
    found = author(run, {5: run.positions(5)}, tmp_path / "clip", quick=True)
    off = [np.linalg.norm(found.run.positions(k) - run.positions(k), axis=1).max() for k in range(len(run))]
    assert max(off[:3]) < 1e-5  # it falls
    assert max(off) < 0.01


def test_an_edit_is_explained_by_the_fabric(sheet, tmp_path):
    truth = simulate(clip_numbers(sheet.scene, ["stretch"]).scene_at(np.log([0.2])))
    found = author(sheet, {8: truth.positions(8)}, tmp_path / "clip", free=["stretch"], rest=False)
    (key,) = found.keys
    assert found.recovery.values["stretch"] == pytest.approx(0.2, rel=0.1)
    assert key.after < 0.5 * key.before
    assert found.intersecting_frames == ()
    assert found.floor[0] < key.before
    assert np.isnan(found.own_floor).all()
    written = json.loads((tmp_path / "clip" / AUTHORED_NAME).read_text())
    assert written["explained"]["factors"] == pytest.approx(dict(found.recovery.values))
    assert open_run(tmp_path / "clip").field("stress").shape == (32, 3, 2)


def test_a_clip_that_misses_its_keys_says_how_far_apart_its_twins_are(sheet, tmp_path):
    found = author(sheet, {5: lifted(sheet, 5)}, tmp_path / "clip", free=["stretch"], rest=False)
    assert found.recovery.misfits[2] > 2 * max(found.recovery.noise)
    assert 0 < found.own_floor[0] < 1e-3
    assert found.as_json()["own_floor"]["start"] == found.own_floor[0]


def test_an_edit_through_the_body_is_counted_and_kept_out(sheet, tmp_path):
    through = sheet.positions(8) - [0, 0, 0.1]
    found = author(sheet, {8: through}, tmp_path / "clip", quick=True)
    assert found.keys[0].intersecting > 0
    assert found.intersecting_frames == ()


def test_offsets_of_a_body_model_turn_with_it(tmp_path):
    """A patch at a hand: its offset in canonical space has the length of the edit, and the key is met exactly."""
    patch = {"mesh": "rectangle", "size": [0.1, 0.1], "cells": [2, 2], "position": [0.0, 0.0, 1.2]}
    body = {"name": "person", "model": "mannequin", "motion": {"clip": "turn", "lead_in": 0.05}}
    scene = clothsim.Scene(
        cloth=patch,
        body=body,
        effects={"inertia": {}},
        run={"duration": 0.16, "frames_per_second": 25, "allow_inside": True},
    )
    run = simulate(scene, tmp_path / "run")
    move = np.array([0.02, 0.0, 0.01])
    edited = run.positions(2) + move
    made = targets(run, edited_frames(run, {2: edited}), "canonical")
    np.testing.assert_allclose(made[2], edited, atol=1e-9)
    np.testing.assert_allclose(made[0], run.positions(0), atol=1e-9)
    moved = made[4] - run.positions(4)
    assert np.linalg.norm(moved, axis=1) == pytest.approx(np.full(9, np.hypot(0.02, 0.01)), rel=0.05)
    assert np.abs(moved - move).max() > 1e-4


def edited_file(run, frame, path):
    run.export(path, frame=frame)
    mesh = files.read_mesh(path)
    n = len(run.positions(0))
    return mesh.positions, mesh.triangles, n


def test_a_file_may_have_the_body_behind_the_cloth(sheet, tmp_path):
    x, triangles, n = edited_file(sheet, 4, tmp_path / "frame.obj")
    assert len(x) > n
    (key,) = edited_frames(sheet, {4: tmp_path / "frame.obj"})
    np.testing.assert_allclose(key.positions, sheet.positions(4), atol=1e-12)
    own = triangles[(triangles < n).all(axis=1)]
    shuffled = files.write_obj(tmp_path / "sorted.obj", x[:n], own[::-1][:, [1, 2, 0]])
    assert len(edited_frames(sheet, {4: shuffled})) == 1
    other = files.write_obj(tmp_path / "other.obj", x[:n][::-1], own)
    assert len(edited_frames(sheet, {4: other})) == 1  # the triangles are those of the run: a mirror is an edit
    wrong = files.write_obj(tmp_path / "wrong.obj", x[:n], np.roll(np.arange(n), 1)[own])
    with pytest.raises(InputError, match="other triangles"):
        edited_frames(sheet, {4: wrong})


@pytest.mark.parametrize(
    ("keys", "word"),
    [
        ({}, "no edited frame"),
        ({0: np.zeros((25, 3))}, "Frame 0"),
        ({9: np.zeros((25, 3))}, "no frame 9"),
        ({-1: np.zeros((25, 3))}, "no frame -1"),
        ({3: np.zeros((24, 3))}, "24 vertices"),
        ({3: np.zeros(3)}, "array"),
        ({3: np.full((25, 3), np.nan)}, "not finite"),
        ({3: "nothing.obj"}, "nothing.obj"),
        ({3: np.full((25, 3), 1e3)}, r"frame 3.*1732 m"),
        ({3: [["a"] * 3] * 25}, "frame 3"),
        ({2.5: np.zeros((25, 3))}, "2.5"),
    ],
)
def test_bad_keys_are_refused(sheet, keys, word):
    with pytest.raises(InputError, match=word):
        edited_frames(sheet, keys)


def test_a_fault_of_a_key_file_is_about_that_file(sheet, tmp_path):
    (tmp_path / "empty.obj").write_text("")
    with pytest.raises(InputError, match="frame 3") as caught:
        edited_frames(sheet, {3: tmp_path / "empty.obj"})
    assert "FRAME.obj" in caught.value.remedy


@pytest.mark.parametrize(
    ("run", "keys", "options", "word"),
    [
        (None, {}, {}, "None"),
        ("sheet", [3], {}, "keys"),
        ("sheet", {}, {"quick": True, "free": ["stretch"]}, "free"),
        ("sheet", {}, {"quick": True, "rest": False}, "rest"),
        ("sheet", {}, {"space": "world"}, "space"),
        ("sheet", {}, {"rate": 20.0}, "rate"),
    ],
)
def test_wrong_types_and_options_of_the_other_form_are_refused(sheet, tmp_path, run, keys, options, word):
    with pytest.raises(InputError, match=word):
        author(sheet if run else None, keys, tmp_path / "clip", **options)


def test_a_run_with_a_rod_has_a_floor_and_numbers_of_its_cloth(tmp_path):
    rod = {"points": [[0, 0, 2], [0.1, 0, 2]], "radius": 1e-3, "youngs_modulus": 1e7}
    effects = {"inertia": {}, "membrane": {}, "gravity": {}, "pins": {"select": "left"}}
    cloth = {"mesh": "rectangle", "size": [0.2, 0.2], "cells": [1, 1]}
    scene = clothsim.Scene(cloth, rod=rod, effects=effects, run={"duration": 0.04, "frames_per_second": 50})
    run = simulate(scene, tmp_path / "run")
    assert clip_numbers(scene).names == ("stretch",)
    author(run, {1: run.positions(1)}, tmp_path / "clip", quick=True, floor=False)
    found = author(run, {1: run.positions(1)}, tmp_path / "clip", free=["stretch"], overwrite=True)
    assert not (tmp_path / "clip" / TARGETS_NAME).exists()
    assert found.recovery.values["stretch"] == pytest.approx(1.0, rel=0.05)
    assert np.isfinite(found.floor).all()


def test_the_run_itself_is_never_the_output(sheet):
    with pytest.raises(InputError):
        author(sheet, {3: sheet.positions(3)}, sheet.directory, overwrite=True)


def test_a_run_that_failed_is_refused(sheet):
    failed = clothsim.Run(sheet.directory, sheet.trajectory, sheet.summary | {"status": "failed"})
    with pytest.raises(InputError, match="failed"):
        edited_frames(failed, {3: sheet.positions(3)})
