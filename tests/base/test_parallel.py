"""Tasks side by side: results in order, errors once no task runs, and no thread left."""

import subprocess
import sys
import threading
from functools import partial

import pytest

from clothsim.base.parallel import threads, together


def helpers():
    return [thread for thread in threading.enumerate() if thread.name.startswith("clothsim")]


@pytest.mark.parametrize("count", [1, 2, 3])
def test_results_come_in_the_order_of_the_tasks_and_no_thread_is_left(count):
    with threads(count):
        for _ in range(20):
            assert together(*(partial(pow, 2, k) for k in range(7))) == [1, 2, 4, 8, 16, 32, 64]
        assert len(helpers()) <= count - 1
    assert helpers() == []


def test_two_tasks_run_at_one_time():
    meeting = threading.Barrier(2)
    with threads(2):
        assert sorted(together(partial(meeting.wait, 60), partial(meeting.wait, 60))) == [0, 1]


def test_short_tasks_and_those_of_one_thread_stay_on_the_caller():
    here = threading.get_ident()
    with threads(2):
        assert together(threading.get_ident, threading.get_ident, long=False) == [here, here]
        assert helpers() == []
    assert together(threading.get_ident, threading.get_ident) == [here, here]


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
@pytest.mark.parametrize("failing", [0, 1])
def test_an_error_is_raised_once_no_task_runs(error, failing):
    begun, ended = threading.Event(), threading.Event()
    free = threading.Event()

    def fails():
        if failing == 0:
            begun.wait(60)  # until the other one runs
            threading.Timer(0.05, free.set).start()
        raise error("this one")

    def runs():
        begun.set()
        if failing == 0:
            free.wait(60)
        ended.set()

    with threads(2), pytest.raises(error, match="this one"):
        together(*((fails, runs) if failing == 0 else (runs, fails)))
    assert ended.is_set()
    assert helpers() == []


def test_tasks_of_a_task_stay_on_its_thread():
    def inner():
        meeting.wait(60)  # both outer tasks have a thread of their own
        return set(together(threading.get_ident, threading.get_ident))

    meeting = threading.Barrier(2)
    with threads(3):
        of_caller, of_helper = together(inner, inner)
    assert len(of_helper) == 1
    assert threading.get_ident() not in of_helper
    assert threading.get_ident() in of_caller


def test_a_block_within_a_block_takes_its_threads():
    with threads(2), threads(8):
        together(*(int for _ in range(20)))
        assert len(helpers()) <= 1


def test_no_import_starts_a_thread():
    code = "import clothsim.solve.stepping.stepping, threading; print(threading.active_count())"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert int(done.stdout) == 1
