"""Compilation of kernels: the time that this process spends on it, from numba's events, and a notice on stderr."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event, Thread
from time import perf_counter
from typing import Any

from numba.core import event

from clothsim import engine
from clothsim.base.kernel_cache import cached_kernels

COMPILE = "numba:compile"
"""Numba's event around a compilation; a kernel that comes from the cache raises none."""

KERNELS = 63
"""Those of a drape on a body with self contact and friction, up to its picture (scenes/sphere.toml)."""

SECONDS = 40
"""Their compilation in two processes on two cores."""

SECONDS_BETWEEN_LINES = 5.0


class CompilationClock(event.Listener):
    """Sum of the seconds of compilation since it was installed, that under way included."""

    def __init__(self) -> None:
        self._depth = 0
        self._began = 0.0
        self._finished = 0.0

    def on_start(self, event: Any) -> None:
        """Begin with the outermost: what a kernel calls is compiled within it."""
        if self._depth == 0:
            self._began = perf_counter()
        self._depth += 1

    def on_end(self, event: Any) -> None:
        """Add the time of the outermost."""
        self._depth -= 1
        if self._depth == 0:
            self._finished += perf_counter() - self._began

    def seconds(self) -> float:
        """Wall time of compilation up to now [s]."""
        return self._finished + (perf_counter() - self._began if self._depth else 0.0)


def installed_clock() -> Any:
    """A context with a clock that listens to numba."""
    return event.install_listener(COMPILE, CompilationClock())


@contextmanager
def compilation_notice() -> Iterator[Callable[[], object]]:
    """Print that kernels are compiled, and how many are, every few seconds until the yielded function is called.

    Nothing is printed where they are in the cache.
    """
    if engine.kernels_are_compiled():
        yield lambda: None
        return
    over, began, before = Event(), perf_counter(), cached_kernels()
    print(f"compiling the kernels once, about {SECONDS} s; later runs find them compiled", file=sys.stderr, flush=True)

    def report() -> None:
        while not over.wait(SECONDS_BETWEEN_LINES):
            print(progress_text(cached_kernels() - before, perf_counter() - began), file=sys.stderr, flush=True)

    Thread(target=report, daemon=True).start()
    try:
        yield over.set
    finally:
        over.set()


def progress_text(done: int, seconds: float) -> str:
    """Number of kernels compiled in that time [s].

    Examples
    --------
    >>> progress_text(20, 8.0)
    'compiling: 20 of about 58 kernels, 8 s'
    """
    return f"compiling: {done} of about {max(KERNELS, done)} kernels, {seconds:.0f} s"
