"""Notice on stderr while the kernels of a first run are compiled."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event, Thread
from time import perf_counter

from clothsim import engine

KERNELS = 58
"""Those of a drape on a body with self contact and friction, up to its picture (scenes/sphere.toml)."""

SECONDS = 40
"""Their compilation in two processes on two cores."""

SECONDS_BETWEEN_LINES = 5.0


@contextmanager
def compilation_notice() -> "Iterator[Callable[[], object]]":
    """Print that kernels are compiled, and how many are, every few seconds until the yielded function is called.

    Nothing is printed where they are in the cache.
    """
    from clothsim.base.kernel_cache import cached_kernels

    if kernels_are_compiled():
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


def kernels_are_compiled() -> bool:
    """True where the kernel that takes longest is in the cache, or where there is no cache."""
    from clothsim.base.kernel_cache import can_store, is_cached

    return is_cached(engine.fill) or not can_store()


def progress_text(done: int, seconds: float) -> str:
    """Number of kernels compiled in that time [s].

    Examples
    --------
    >>> progress_text(20, 8.0)
    'compiling: 20 of about 58 kernels, 8 s'
    """
    return f"compiling: {done} of about {max(KERNELS, done)} kernels, {seconds:.0f} s"
