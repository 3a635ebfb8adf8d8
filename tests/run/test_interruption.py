"""Ctrl-C: stopped between two iterates or steps, never lost, and resumed with the same bits."""

import contextlib
import os
import signal
import threading

import numpy as np
import pytest
from small_scenes import BALL, RUN, small_scene

from clothsim import open_run, resume, simulate
from clothsim.base.interruption import InterruptFlag, interruption
from clothsim.solve.stepping import stepping

FALL = {"effects": {"inertia": {}, "gravity": {}}, "body": (), "run": {**RUN, "duration": 0.16}}


@pytest.fixture(autouse=True)
def default_handler():
    """Python's own handler of SIGINT, which a process that a shell started in the background does not have."""
    handler = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, handler)


def interrupt():
    os.kill(os.getpid(), signal.SIGINT)


def swallow(_):
    """A callback from compiled code: the exception goes nowhere."""
    with contextlib.suppress(KeyboardInterrupt):
        interrupt()


def frames(run):
    return np.array([run.positions(k) for k in range(len(run.times))])


def test_an_interrupt_in_a_callback_that_swallows_exceptions_stops_the_run(tmp_path):
    steps = []

    def on_step(state):
        steps.append(state.step)
        if state.step == 5:
            swallow(state)

    with pytest.raises(KeyboardInterrupt):
        simulate(small_scene(**FALL), tmp_path / "stopped", on_step=on_step)
    assert steps == [1, 2, 3, 4, 5]
    assert open_run(tmp_path / "stopped").status == "interrupted"
    whole = simulate(small_scene(**FALL), tmp_path / "whole")
    assert np.array_equal(frames(resume(tmp_path / "stopped")), frames(whole))


def test_an_interrupt_after_the_last_step_is_not_lost(tmp_path):
    def on_step(state):
        if state.step == 8:
            interrupt()

    with pytest.raises(KeyboardInterrupt):
        simulate(small_scene(**FALL), tmp_path, on_step=on_step)
    assert resume(tmp_path).status == "completed"


def test_newton_s_method_stops_at_its_next_iterate(tmp_path, monkeypatch):
    """A step of a large cloth takes minutes."""
    solves = []
    scene = small_scene(body=BALL)

    def listen(progress):
        solves.append(progress.step)

    original = stepping.Newton

    def counting(bound, system, settings, h, observe, *rest):
        def observed(iterate):
            if solves and solves[-1] == 3:
                solves.append("iterate")
                swallow(iterate)
            observe(iterate)

        return original(bound, system, settings, h, observed, *rest)

    monkeypatch.setattr(stepping, "Newton", counting)
    with pytest.raises(KeyboardInterrupt):
        simulate(scene, tmp_path, progress=listen)
    assert solves == [1, 2, 3, "iterate"]


def interrupted_twice():
    with interruption() as flag:
        assert signal.getsignal(signal.SIGINT) is flag
        interrupt()
        with interruption() as inner:
            assert inner is flag
            with pytest.raises(KeyboardInterrupt):
                flag.check()
        with pytest.raises(KeyboardInterrupt):
            interrupt()


def test_a_second_interrupt_raises_at_once_and_the_handler_is_put_back():
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        interrupted_twice()
    assert signal.getsignal(signal.SIGINT) is before


def test_a_thread_and_a_program_with_its_own_handler_keep_theirs():
    seen = []

    def in_thread():
        with interruption():
            seen.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=in_thread)
    thread.start()
    thread.join()
    assert not isinstance(seen[0], InterruptFlag)
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with interruption():
            assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)
