"""Interruption by Ctrl-C: a flag that long work reads where it can stop."""

import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import wraps
from types import FrameType
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
Result = TypeVar("Result")

_NOTICE = b"\nStopping after this iteration; Ctrl-C again: at once.\n"


class InterruptFlag:
    """A handler of SIGINT that sets a flag; the second signal raises KeyboardInterrupt at once."""

    def __init__(self) -> None:
        self._set = False

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Set the flag."""
        if self._set:
            raise KeyboardInterrupt
        self._set = True
        with suppress(OSError):
            if os.isatty(2):
                os.write(2, _NOTICE)  # print is not safe in a handler

    def check(self) -> None:
        """Raise KeyboardInterrupt where the flag is set."""
        if self._set:
            raise KeyboardInterrupt


@contextmanager
def interruption() -> Iterator[InterruptFlag]:
    """A flag for SIGINT within the block; set at its end, it raises KeyboardInterrupt there.

    An exception at any point of the code may come in the middle of a write, and is lost where a callback from compiled
    code ignores it. A thread that is not the main one, and a program with its own handler, keep what they have; a run
    within a callback of another run shares its flag.
    """
    handler = signal.getsignal(signal.SIGINT)
    if isinstance(handler, InterruptFlag):
        yield handler
        return
    flag = InterruptFlag()
    if handler is not signal.default_int_handler or threading.current_thread() is not threading.main_thread():
        yield flag
        return
    signal.signal(signal.SIGINT, flag)
    try:
        yield flag
    finally:
        signal.signal(signal.SIGINT, handler)
    flag.check()


def held_back(function: Callable[P, Result]) -> Callable[P, Result]:
    """A function during which Ctrl-C waits: the KeyboardInterrupt comes when the function has ended.

    Numba and LLVM ignore an exception within their callbacks, so that a Ctrl-C in the first tenth of a second of a run
    was lost, and the run went on. Threads and handlers of a program are left alone, as by `interruption`.
    """

    @wraps(function)
    def uninterrupted(*given: P.args, **named: P.kwargs) -> Result:
        default = signal.getsignal(signal.SIGINT) is signal.default_int_handler
        if not default or threading.current_thread() is not threading.main_thread():
            return function(*given, **named)
        waiting: list[int] = []
        signal.signal(signal.SIGINT, lambda number, frame: waiting.append(number))
        try:
            return function(*given, **named)
        finally:
            signal.signal(signal.SIGINT, signal.default_int_handler)
            if waiting:
                raise KeyboardInterrupt

    return uninterrupted
