"""Ctrl-C that waits until kernels are loaded or compiled."""

import signal
import threading

import numpy as np
import pytest

from clothsim.base.interruption import held_back, interruption
from clothsim.base.jit import kernel


@pytest.fixture(autouse=True)
def _python_s_own_handler():
    """In the background of a shell SIGINT is ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@held_back
def interrupted(steps: list[str]) -> str:
    signal.raise_signal(signal.SIGINT)
    steps.append("after the signal")
    return "result"


def test_ctrl_c_waits_for_the_end_of_the_function():
    steps: list[str] = []
    with pytest.raises(KeyboardInterrupt):
        interrupted(steps)
    assert steps == ["after the signal"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_ctrl_c_waits_for_the_outermost_of_two():
    steps: list[str] = []

    @held_back
    def outer() -> None:
        interrupted(steps)
        steps.append("outer")

    with pytest.raises(KeyboardInterrupt):
        outer()
    assert steps == ["after the signal", "outer"]


def test_a_result_and_an_error_pass():
    assert held_back(len)([1, 2]) == 2
    with pytest.raises(ZeroDivisionError):
        held_back(lambda: 1 / 0)()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_the_handler_of_a_program_is_called_at_once():
    received: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, frame: received.append(number))
    try:
        assert interrupted([]) == "result"
    finally:
        signal.signal(signal.SIGINT, before)
    assert received == [signal.SIGINT]


def within_a_run() -> None:
    with interruption():
        assert interrupted([]) == "result"


def test_the_flag_of_a_run_takes_the_signal():
    with pytest.raises(KeyboardInterrupt):
        within_a_run()


def test_another_thread_calls_the_function():
    results: list[int] = []
    thread = threading.Thread(target=lambda: results.append(held_back(len)("ab")))
    thread.start()
    thread.join()
    assert results == [2]


def test_a_kernel_is_compiled_with_ctrl_c_held_back(monkeypatch):
    def squared(x):
        return x * x

    compiled = kernel(squared)
    if compiled is squared:
        pytest.skip("NUMBA_DISABLE_JIT is set")
    handlers = []
    load = type(compiled._cache).load_overload

    def observed(*given):
        handlers.append(signal.getsignal(signal.SIGINT))
        return load(*given)

    monkeypatch.setattr(type(compiled._cache), "load_overload", observed)
    assert compiled(np.float64(3.0)) == 9.0
    assert handlers
    assert signal.default_int_handler not in handlers
