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
    """Sum of the seconds of compilation since it was installed, that under way included.

    Attributes
    ----------
    kernel : str
        Module and name of the kernel under way, or of the last one; empty before the first.
    """

    def __init__(self) -> None:
        self.kernel = ""
        self._depth = 0
        self._began = 0.0
        self._finished = 0.0

    def on_start(self, event: Any) -> None:
        """Begin with the outermost: what a kernel calls is compiled within it."""
        if self._depth == 0:
            self._began = perf_counter()
            function = getattr(event.data["dispatcher"], "py_func", None)
            self.kernel = "" if function is None else f"{function.__module__.rpartition('.')[2]}.{function.__name__}"
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
def compilation_notice(clock: CompilationClock) -> Iterator[Callable[[], object]]:
    """Print that kernels are compiled, how many and which, every few seconds until the yielded function is called.

    Nothing is printed where they are in the cache.
    """
    if engine.kernels_are_compiled():
        yield lambda: None
        return
    over, began, before = Event(), perf_counter(), cached_kernels()
    print(f"compiling the kernels once, about {SECONDS} s; later runs find them compiled", file=sys.stderr, flush=True)

    def report() -> None:
        while not over.wait(SECONDS_BETWEEN_LINES):
            line = progress_text(cached_kernels() - before, perf_counter() - began, clock.kernel)
            print(line, file=sys.stderr, flush=True)

    Thread(target=report, daemon=True).start()
    try:
        yield over.set
    finally:
        over.set()


def progress_text(done: int, seconds: float, kernel: str) -> str:
    """Number of kernels compiled in that time [s], and the one under way.

    Examples
    --------
    >>> progress_text(20, 8.0, "membrane_kernels.fill")
    'compiling: 20 of about 63 kernels, 8 s (membrane_kernels.fill)'
    """
    now = f" ({kernel})" if kernel else ""
    return f"compiling: {done} of about {max(KERNELS, done)} kernels, {seconds:.0f} s{now}"
