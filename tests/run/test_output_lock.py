"""Output directories: one run at a time, no run replaced unasked, no link followed."""

import json
import multiprocessing
import os
import platform
import signal
import time

import pytest
from small_scenes import RUN, small_scene

from clothsim import InputError, open_run, resume, simulate
from clothsim.base.record import RECORD_NAME, SUMMARY_NAME
from clothsim.files.runs.checkpoint import CHECKPOINT_NAME
from clothsim.files.runs.run_lock import LOCK_NAME, locked
from clothsim.files.runs.trajectory import TRAJECTORY_NAME

FALL = {"effects": {"inertia": {}, "gravity": {}}, "body": (), "run": {**RUN, "duration": 0.04}}


class StoppedError(Exception):
    """Raised by a listener to stop a run."""


def stop(_):
    raise StoppedError


@pytest.mark.parametrize("second", [lambda path: simulate(small_scene(**FALL), path, overwrite=True), resume])
def test_a_second_run_in_the_same_directory_is_refused_by_the_name_of_the_first(tmp_path, second):
    refusals = []

    def start_another(_):
        with pytest.raises(InputError) as caught:
            second(tmp_path)
        refusals.append(caught.value.sentence)

    run = simulate(small_scene(**FALL), tmp_path, on_step=start_another)
    assert len(refusals) == run.summary["steps"] == 2
    assert all(str(os.getpid()) in sentence and platform.node() in sentence for sentence in refusals)
    assert len(open_run(tmp_path).times) == 2
    assert not (tmp_path / LOCK_NAME).exists()


def hold(directory, taken):
    with locked(directory):
        taken.set()
        time.sleep(60)


def test_the_lock_of_a_killed_process_is_taken_over(tmp_path):
    context = multiprocessing.get_context("spawn")
    taken = context.Event()
    holder = context.Process(target=hold, args=(tmp_path, taken), daemon=True)
    holder.start()
    assert taken.wait(60)
    with pytest.raises(InputError, match=str(holder.pid)):
        simulate(small_scene(**FALL), tmp_path)
    os.kill(holder.pid, signal.SIGKILL)
    holder.join()
    assert json.loads((tmp_path / LOCK_NAME).read_text())["pid"] == holder.pid
    assert simulate(small_scene(**FALL), tmp_path).status == "completed"
    assert not (tmp_path / LOCK_NAME).exists()


@pytest.mark.parametrize("content", ["", "{", "[]", "[" * 4096, '{"pid": 1}'], ids=len)
def test_a_lock_of_another_host_is_left_alone_and_one_that_says_nothing_is_taken(tmp_path, content):
    lock = tmp_path / LOCK_NAME
    lock.write_text(json.dumps({"pid": 1, "host": "elsewhere", "started": "2026-11-22"}))
    with pytest.raises(InputError, match="elsewhere"):
        simulate(small_scene(**FALL), tmp_path)
    assert lock.exists()
    lock.write_text(content)
    if content == '{"pid": 1}':  # of no host that is known
        with pytest.raises(InputError, match="process 1"):
            simulate(small_scene(**FALL), tmp_path)
    else:
        assert simulate(small_scene(**FALL), tmp_path).status == "completed"


def test_an_earlier_run_is_replaced_on_request_only(tmp_path):
    first = simulate(small_scene(**FALL), tmp_path)
    with pytest.raises(InputError, match="overwrite=True"):
        simulate(small_scene(**FALL), tmp_path)
    assert open_run(tmp_path).summary == first.summary
    again = simulate(small_scene(**{**FALL, "run": {**RUN, "duration": 0.08}}), tmp_path, overwrite=True)
    assert len(open_run(tmp_path).times) == len(again.times) == 3


def test_a_stopped_run_points_at_resume(tmp_path):
    with pytest.raises(StoppedError):
        simulate(small_scene(**FALL), tmp_path, on_step=stop)
    with pytest.raises(InputError, match="resume"):
        simulate(small_scene(**FALL), tmp_path)
    assert resume(tmp_path).status == "completed"


def test_a_directory_that_holds_no_run_is_written_to(tmp_path):
    (tmp_path / "thesis.txt").write_text("all my work")
    assert simulate(small_scene(**FALL), tmp_path).status == "completed"
    assert (tmp_path / "thesis.txt").read_text() == "all my work"


@pytest.mark.parametrize("name", [TRAJECTORY_NAME, RECORD_NAME, SUMMARY_NAME, CHECKPOINT_NAME])
def test_a_link_in_the_directory_is_not_followed(tmp_path, name):
    outside, inside = tmp_path / "precious", tmp_path / "run"
    outside.write_text("all my work")
    inside.mkdir()
    (inside / name).symlink_to(outside)
    run = simulate(small_scene(**FALL), inside, overwrite=True)
    assert outside.read_text() == "all my work"
    assert not (inside / name).is_symlink()
    (inside / name).rename(tmp_path / "moved")
    (inside / name).symlink_to(tmp_path / "moved")
    before = (tmp_path / "moved").read_bytes()
    with pytest.raises(InputError, match=name):
        resume(inside)
    assert (tmp_path / "moved").read_bytes() == before
    assert run.status == "completed"


def test_a_link_in_the_place_of_the_lock_is_refused(tmp_path):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / LOCK_NAME).symlink_to(tmp_path / "precious")
    with pytest.raises(InputError, match=LOCK_NAME):
        simulate(small_scene(**FALL), tmp_path / "run")
    assert not (tmp_path / "precious").exists()
