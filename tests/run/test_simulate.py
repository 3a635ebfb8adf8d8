"""simulate() and resume(): output files, bitwise resume, and scripted scenes."""

import re

import ipctk
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from small_scenes import BALL, EFFECTS, RUN, SHEET, SOLVER, small_scene, without

from clothsim import InputError, IntersectionWarning, open_run, resume, simulate
from clothsim.base.record import RECORD_NAME, SUMMARY_NAME
from clothsim.files.runs.checkpoint import CHECKPOINT_NAME, read_checkpoint
from clothsim.files.runs.trajectory import TRAJECTORY_NAME
from clothsim.run import recorded_run
from clothsim.run.fields import FIELDS
from clothsim.scene.scene import Scene
from clothsim.solve.stepping.mechanical_energy import ALLOWED

FILES = {TRAJECTORY_NAME, RECORD_NAME, SUMMARY_NAME, CHECKPOINT_NAME}


class StoppedError(Exception):
    """Raised by a listener to stop a run."""


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """The small scene, run to its end."""
    return simulate(small_scene(), tmp_path_factory.mktemp("run"))


def frames(run):
    return np.array([run.positions(k) for k in range(len(run.times))])


def never_intersects(run):
    """ipctk on each saved frame, on surfaces made here: cloths and bodies, everything against everything."""
    for k in range(len(run.times)):
        positions, triangles = [run.positions(k)], [run.triangles]
        for _, points, faces in run.bodies(k):
            triangles.append(faces + sum(map(len, positions)))
            positions.append(points)
        faces = np.asfortranarray(np.concatenate(triangles).astype(np.int32))
        points = np.asfortranarray(np.concatenate(positions))
        mesh = ipctk.CollisionMesh(points, ipctk.edges(faces), faces)
        if ipctk.has_intersections(mesh, points):
            return False
    return True


# --- what a run leaves ----------------------------------------------------------------------------------------------


def test_all_files_are_there_and_open_again(run):
    assert {path.name for path in run.directory.iterdir()} == FILES
    again = open_run(run.directory)
    assert again.status == "completed"
    assert np.array_equal(again.positions(-1), run.positions(-1))
    assert again.summary == run.summary


def test_frames_are_at_their_times_and_the_cloth_fell_on_the_ball(run):
    assert run.times == pytest.approx([0, 0.04, 0.08, 0.12, 0.16], abs=1e-15)
    assert run.positions(0)[:, 2] == pytest.approx(0.33)
    assert run.positions(-1)[:, 2].min() < 0.30
    assert run.positions(-1)[12, 2] > 0.3
    assert [name for name, _, _ in run.bodies(0)] == ["ball"]
    assert run.stretches(-1).shape == (32, 2)
    assert never_intersects(run)


def test_summary_and_record_tell_the_same(run):
    summary, record = run.summary, run.record()
    assert summary["steps"] == len(record) == 8
    assert summary["newton_iterations"] == sum(entry["newton_iterations"] for entry in record)
    assert summary["linear_solves"] >= summary["newton_iterations"]
    assert set(summary["effects"]) == set(EFFECTS)
    assert all(account["gradients"] > 0 for account in summary["effects"].values())
    assert summary["vertices"] == 25
    certificate = summary["certificate"]
    assert certificate["intersection_free"] is True
    assert 0 < certificate["minimum_gap"] < 0.025
    assert certificate["minimum_gap"] == min(entry["minimum_gap"] or np.inf for entry in record)
    assert 0.9 < certificate["stretch_min"] <= certificate["stretch_max"] < 1.1
    booked = sum(summary["phases"].values()) + sum(account["seconds"] for account in summary["effects"].values())
    assert 0 < booked <= summary["wall_seconds"]


def test_the_listener_hears_every_step():
    received = []
    run = simulate(small_scene(), progress=received.append)
    assert [progress.step for progress in received] == list(range(1, 9))
    assert received[-1].time == received[-1].duration == 0.16
    assert [progress.newton_iterations for progress in received] == [e["newton_iterations"] for e in run.record()]


def test_on_step_gets_the_state_of_every_step_and_changes_no_bit(run):
    states = []
    again = simulate(small_scene(), on_step=states.append)
    assert [state.step for state in states] == list(range(1, 9))
    assert np.array_equal(states[-1].positions["cloth"], run.positions(-1))
    assert np.array_equal(frames(again), frames(run))


def test_the_same_run_twice_has_the_same_bits(run, tmp_path):
    assert np.array_equal(frames(simulate(small_scene(), tmp_path)), frames(run))


# --- stop and resume ------------------------------------------------------------------------------------------------


def stopped_after(directory, scene, steps):
    def listen(progress):
        if progress.step == steps:
            raise StoppedError

    with pytest.raises(StoppedError):
        simulate(scene, directory, progress=listen)


@pytest.mark.parametrize("steps", [1, 4, 5])
def test_a_resumed_run_has_the_bits_of_one_that_never_stopped(run, tmp_path, steps):
    """StoppedError within frame 1, at the end of frame 2 before it was written, and within frame 3."""
    stopped_after(tmp_path, small_scene(), steps)
    stopped = open_run(tmp_path)
    assert stopped.status == "interrupted"
    assert np.array_equal(frames(stopped), frames(run)[: len(stopped.times)])
    resumed = resume(tmp_path)
    assert resumed.status == "completed"
    assert np.array_equal(frames(resumed), frames(run))
    assert np.array_equal(resumed.times, run.times)
    exact = ("step", "time", "dt", "newton_iterations", "energy", "minimum_gap", "fastest", "residual")
    assert [[e[k] for k in exact] for e in resumed.record()] == [[e[k] for k in exact] for e in run.record()]
    for key in ("steps", "newton_iterations", "certificate", "off", "stages"):
        assert resumed.summary[key] == run.summary[key]


@pytest.mark.parametrize("steps", [1, 5])
def test_a_resumed_run_of_bdf2_has_the_bits_of_one_that_never_stopped(tmp_path, steps):
    """The checkpoint knows the state a step earlier; after the first step only the start is."""
    effects = EFFECTS | {"friction": {"coefficient": 0.4}}
    scene = small_scene(effects=effects, solver=SOLVER | {"integrator": "bdf2"}, run={"duration": 0.24})
    whole = simulate(scene, tmp_path / "whole")
    assert whole.status == "completed", whole.reason
    assert whole.summary["certificate"]["minimum_gap"] > 0
    assert whole.summary["certificate"]["energy_drift"] < ALLOWED
    assert whole.summary["certificate"]["step_energy_rise"] < 1e-12
    stopped_after(tmp_path / "part", scene, steps)
    assert (read_checkpoint(tmp_path / "part" / CHECKPOINT_NAME).state.previous is None) == (steps == 1)
    resumed = resume(tmp_path / "part")
    assert np.array_equal(frames(resumed), frames(whole))
    assert resumed.summary["certificate"] == whole.summary["certificate"]
    assert never_intersects(whole)


@pytest.mark.parametrize(("seconds", "frame"), [(0.0, 2), (1e9, 0)])
def test_a_killed_run_goes_on_from_the_checkpoint_that_was_written_in_time(run, tmp_path, monkeypatch, seconds, frame):
    """Nothing is written at the end of a process that is killed; the frames after the checkpoint are taken again."""
    monkeypatch.setattr(recorded_run, "SECONDS_BETWEEN_CHECKPOINTS", seconds)
    monkeypatch.setattr(recorded_run._Checkpoints, "__exit__", lambda *error: None)
    stopped_after(tmp_path, small_scene(), 5)
    assert read_checkpoint(tmp_path / CHECKPOINT_NAME).state.frame == frame
    assert len(open_run(tmp_path)) == 3
    monkeypatch.undo()
    resumed = resume(tmp_path)
    assert np.array_equal(frames(resumed), frames(run))
    assert resumed.summary["certificate"] == run.summary["certificate"]
    assert [entry["step"] for entry in resumed.record()] == [entry["step"] for entry in run.record()]


def test_a_resumed_run_writes_the_fields_of_one_that_never_stopped(run, tmp_path):
    scene = small_scene(run=RUN | {"fields": list(FIELDS)})
    whole = simulate(scene, tmp_path / "whole")
    stopped_after(tmp_path / "stopped", scene, 5)
    resumed = resume(tmp_path / "stopped")
    assert np.array_equal(frames(whole), frames(run))
    assert set(whole.trajectory.fields) == set(FIELDS)
    assert set(run.trajectory.fields) == {"principal_stretches"}
    for name in FIELDS:
        for k in range(len(whole)):
            values = whole.trajectory.field(name, k)
            assert np.isfinite(values).all()
            assert np.array_equal(resumed.trajectory.field(name, k), values)
            if FIELDS[name].in_step:
                with pytest.raises(InputError, match=r"run\.fields"):
                    run.field(name, k)
            else:  # computed from the positions of a run that did not write it
                scale = max(1e-3, float(np.abs(values).max()))
                np.testing.assert_allclose(run.field(name, k), values, rtol=1e-6, atol=1e-6 * scale)
    assert np.array_equal(whole.field("stress", -2), whole.trajectory.field("stress", 3))
    assert not whole.trajectory.field("contact_pressure", 0).any()
    assert whole.trajectory.field("contact_pressure", -1).max() > 0


@pytest.mark.parametrize("integrator", ["backward_euler", "bdf2"])
def test_a_run_that_was_asked_for_an_error_takes_fixed_steps_and_resumes_to_the_same_bits(tmp_path, integrator):
    solver = {"error": 0.1, "integrator": integrator, "threads": 1, "linear": "superlu"}
    scene = small_scene(effects=EFFECTS | {"friction": {"coefficient": 0.4}}, solver=solver, run={"duration": 0.24})
    sessions = []
    whole = simulate(scene, tmp_path / "whole", announce=sessions.append)
    assert whole.status == "completed", whole.reason
    assert whole.times == pytest.approx(0.04 * np.arange(7))
    reported = whole.summary["certificate"]["error_estimate"]
    record = whole.record()
    assert reported["asked"] == 0.1
    assert reported["met"] is True
    assert 0.001 < reported["total"] <= 0.105
    assert reported["chosen"]["integrator"] == integrator
    assert reported["temporal"] == pytest.approx(sum(entry["error"] for entry in record))
    assert [entry["dt"] for entry in record] == pytest.approx([reported["chosen"]["dt"]] * len(record))
    assert never_intersects(whole)
    stopped_after(tmp_path / "part", sessions[-1].scene, len(record) // 2)
    resumed = resume(tmp_path / "part")
    assert np.array_equal(frames(resumed), frames(whole))


def test_bdf2_without_inertia_is_quasi_static_and_reports_it(tmp_path):
    effects = {"membrane": {}, "bending": {}, "gravity": {}, "pins": {"select": "left"}}
    runs = []
    for integrator in ("backward_euler", "bdf2"):
        solver = SOLVER | {"dt": 0.08, "integrator": integrator}
        runs.append(simulate(small_scene(body=(), effects=effects, solver=solver), tmp_path / integrator))
    assert np.array_equal(*(frames(run) for run in runs))
    assert "bdf2 does nothing without effects.inertia." in runs[1].summary["notes"]


def test_resume_with_the_solver_that_is_chosen_by_itself(tmp_path):
    scene = small_scene(solver=SOLVER | {"linear": "auto"})
    whole = simulate(scene, tmp_path / "whole")
    stopped_after(tmp_path / "part", scene, 5)
    assert np.array_equal(frames(resume(tmp_path / "part")), frames(whole))


def test_a_finished_run_resumed_stays_as_it_is(tmp_path):
    run = simulate(small_scene(), tmp_path)
    before = frames(run)
    again = resume(tmp_path)
    assert again.status == "completed"
    assert np.array_equal(frames(again), before)


def test_the_checkpoint_is_the_last_frame(run):
    saved = read_checkpoint(run.directory / CHECKPOINT_NAME).state
    assert (saved.frame, saved.step, saved.time) == (4, 8, 0.16)
    assert np.array_equal(saved.positions[:25], run.positions(-1))


def test_no_frame_writes_the_scene_as_text_again(tmp_path, monkeypatch):
    """The meshes in memory of a dressing are megabytes of it."""
    to_text, counts = Scene.to_text, []
    for duration in (0.04, 0.16):
        texts = []
        monkeypatch.setattr(
            Scene, "to_text", lambda *given, seen=texts, **more: seen.append(1) or to_text(*given, **more)
        )
        simulate(small_scene(run={"duration": duration}), tmp_path / str(duration))
        counts.append(len(texts))
    assert counts[0] == counts[1] > 0


def test_nothing_to_resume_is_refused(tmp_path):
    with pytest.raises(InputError, match="checkpoint"):
        resume(tmp_path)


# --- scripted scenes ------------------------------------------------------------------------------------------------


def test_a_ball_that_rises_and_turns_moves_the_sheet(tmp_path):
    motion = {"velocity": [0.0, 0.0, 1.0], "rotate_degrees_per_second": [0.0, 0.0, 200.0]}
    run = simulate(small_scene(body=BALL | {"motion": motion}, effects=without("gravity")), tmp_path)
    assert run.status == "completed", run.reason
    start, end = run.bodies(0)[0][1], run.bodies(-1)[0][1]
    turned = Rotation.from_euler("z", 200 * 0.16, degrees=True).apply(start)
    assert np.abs(end - turned - [0, 0, 0.16]).max() < 1e-14
    assert run.positions(-1)[12, 2] > 0.3 + 0.16
    assert run.summary["certificate"]["energy_drift"] == "bodies, pins or wind do work"
    assert never_intersects(run)


def test_pins_move_by_their_script_and_the_sheet_follows(tmp_path):
    pins = {"select": "left", "motion": {"velocity": [0.0, 0.0, 1.0], "rotate_degrees_per_second": [0, 90, 0]}}
    run = simulate(small_scene(body=(), effects=without("body_contact") | {"pins": pins}), tmp_path)
    assert run.status == "completed", run.reason
    left = np.flatnonzero(run.positions(0)[:, 0] < -0.499)
    start = run.positions(0)[left]
    for k, time in enumerate(run.times):
        turn = Rotation.from_euler("y", 90 * time, degrees=True)
        expected = turn.apply(start - start.mean(axis=0)) + start.mean(axis=0) + [0, 0, time]
        assert np.abs(run.positions(k)[left] - expected).max() < 1e-13
    others = np.setdiff1d(np.arange(25), left)
    assert np.ptp(run.positions(-1)[others, 2]) > 0.05


def test_a_clamped_edge_holds_its_direction(tmp_path):
    """Stiff in bending: a clamped sheet sticks out, a pinned one swings down."""
    stiff = SHEET | {"bending_stiffness": 20.0}
    lowest = []
    for clamp in (True, False):
        pins = {"select": "left", "clamp": clamp}
        scene = small_scene(cloth=stiff, body=(), effects=without("body_contact") | {"pins": pins})
        run = simulate(scene, tmp_path / str(clamp))
        assert run.status == "completed", run.reason
        lowest.append(0.33 - run.positions(-1)[:, 2].min())
    assert 0 < lowest[0] < 0.05
    assert lowest[1] > 0.1


def test_two_cloths_and_two_bodies(tmp_path):
    cloths = [SHEET | {"name": "a"}, SHEET | {"name": "b", "position": [3.0, 0.0, 0.33], "cells": [3, 3]}]
    bodies = [BALL, BALL | {"name": "other", "position": [3.0, 0.0, 0.0]}]
    run = simulate(small_scene(cloth=cloths, body=bodies), tmp_path)
    assert run.status == "completed", run.reason
    assert run.cloth_names == ("a", "b")
    assert [name for name, _, _ in run.bodies(-1)] == ["ball", "other"]
    assert run.positions(-1).shape == (25 + 16, 3)
    assert never_intersects(run)


def test_a_cloth_alone_moves_as_it_does_beside_another(run, tmp_path):
    cloths = [SHEET, SHEET | {"position": [50.0, 0.0, 0.33]}]
    both = simulate(small_scene(cloth=cloths), tmp_path)
    assert np.abs(frames(both)[:, :25] - frames(run)).max() < 1e-3


def test_contact_without_a_membrane_runs(tmp_path):
    run = simulate(small_scene(effects=without("membrane", "bending")), tmp_path)
    assert run.status == "completed", run.reason
    assert never_intersects(run)


def test_a_quasi_static_scene_ramps_its_load(tmp_path):
    pins = {"select": "left"}
    scene = small_scene(
        cloth=SHEET | {"rotation_degrees": [0.0, 90.0, 0.0]},
        body=(),
        effects={"membrane": {}, "bending": {}, "gravity": {}, "pins": pins},
        solver=SOLVER | {"dt": 0.08, "tolerance": 1e-6},
    )
    run = simulate(scene, tmp_path)
    assert run.status == "completed", run.reason
    drops = run.positions(0)[:, 2].min() - frames(run)[:, :, 2].min(axis=1)
    assert drops[-1] > 0
    assert drops[2] == pytest.approx(drops[-1] / 2, rel=0.05)


# --- what cannot be -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("height", [0.0, 0.2, -0.25])
def test_a_body_in_the_cloth_at_the_start_is_refused_in_one_sentence(tmp_path, height):
    scene = small_scene(cloth=SHEET | {"position": [0.0, 0.0, height]})
    with pytest.raises(InputError, match=r"cloth.*ball") as refusal:
        simulate(scene, tmp_path / "never")
    assert str(refusal.value).count("\n") == 0
    assert not (tmp_path / "never").exists()


def test_pins_driven_into_a_body_end_the_run_with_the_reason_and_keep_its_frames(tmp_path):
    pins = {"select": [12], "motion": {"velocity": [0.0, 0.0, -0.5]}}
    run = simulate(small_scene(effects=without("gravity") | {"pins": pins}), tmp_path)
    assert run.status == "failed"
    assert re.search(r"\b12\b.*cloth.*pins", run.reason)
    assert "ball" in run.reason
    assert run.summary["failure"]["cause"] == "blocked"
    assert len(run.times) >= 2
    assert never_intersects(run)
    assert open_run(tmp_path).status == "failed"


def test_without_contact_an_intersection_is_reported_and_the_run_goes_on(tmp_path):
    with pytest.warns(IntersectionWarning):
        run = simulate(small_scene(effects=without("body_contact")), tmp_path)
    assert run.status == "completed"
    assert not never_intersects(run)
    assert run.summary["certificate"]["intersection_free"] is False
    assert run.summary["certificate"]["intersecting_frames"]


@pytest.mark.parametrize("callback", ["on_step", "progress", "announce"])
@pytest.mark.parametrize("start", [lambda path, **callbacks: simulate(small_scene(), path, **callbacks), resume])
def test_what_cannot_be_called_is_refused_before_the_first_step(tmp_path, start, callback):
    with pytest.raises(InputError) as caught:
        start(tmp_path / "never", **{callback: 3})
    assert callback in caught.value.sentence
    assert not (tmp_path / "never").exists()


def test_an_output_that_cannot_be_made_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="run"):
        simulate(small_scene(), tmp_path / "file" / "run")
