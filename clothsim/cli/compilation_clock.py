"""Time that this process spends compiling kernels, from numba's events."""

from time import perf_counter
from typing import Any

from numba.core import event

COMPILE = "numba:compile"
"""Numba's event around a compilation; a kernel that comes from the cache raises none."""


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
