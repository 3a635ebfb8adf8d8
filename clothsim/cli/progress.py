"""Progress on stderr: a bar on a terminal, a plain line every few seconds elsewhere; before them, compilation.

The estimate of what is left excludes the time that kernels take to compile: the first step of a first run has most.
"""

import sys
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import asdict
from threading import Event, Thread
from time import perf_counter
from typing import TYPE_CHECKING, Any, TypeVar, cast

from clothsim import engine
from clothsim.base.text import length_text
from clothsim.cli import on_demand
from clothsim.cli.report import stream

if TYPE_CHECKING:
    from clothsim import Progress

SECONDS_BETWEEN_LINES = 5.0


Listener = TypeVar("Listener", bound=Callable[..., None])


@contextmanager
def listener_for(
    quiet: bool, bar: "Callable[[], AbstractContextManager[Listener]]", lines: Listener
) -> "Iterator[Listener]":
    """The callback of a command: none where `quiet`, events with --json, a bar on a terminal, else lines."""
    own = stream()
    if quiet:
        yield cast("Listener", lambda progress: None)
    elif own is not None and isinstance(lines, Lines):
        yield cast("Listener", lambda progress: own.event("progress", **asdict(progress)))
    elif sys.stderr.isatty():
        with bar() as listener:
            yield listener
    else:
        yield lines


@contextmanager
def progress_on_stderr(quiet: bool) -> "Iterator[Callable[[Progress], None]]":
    """A callback for `simulate` that shows each step on stderr; before the first, that kernels are compiled."""
    if quiet:
        yield lambda progress: None
        return
    with installed_clock() as compiling, compilation_notice(compiling) as end_notice:

        def now() -> float:
            return perf_counter() - compiling.seconds()

        lines: Callable[[Progress], None] = Lines(now)
        with listener_for(quiet, lambda: _bar(now), lines) as listener:

            def first_ends_notice(progress: "Progress") -> None:
                end_notice()
                listener(progress)

            yield first_ends_notice


WINDOW = 8
"""Steps, the last ones, by which what is left is estimated: the first ones of a stage take longer."""


class Pace:
    """Estimate of what is left of a run, by its last steps."""

    def __init__(self) -> None:
        self._seen: deque[tuple[float, float]] = deque(maxlen=WINDOW + 1)

    def left(self, now: float, progress: "Progress") -> float | None:
        """Seconds to the end of the duration; None before the second step. now: a clock at this step [s].

        Examples
        --------
        >>> from clothsim import Progress
        >>> pace = Pace()
        >>> for step, now in ((1, 90.0), (2, 91.0), (3, 92.0)):
        ...     left = pace.left(now, Progress(0.1 * step, 1.0, step, 1, 0.0, 0.0, "moving", now))
        >>> round(left, 6)
        7.0
        """
        self._seen.append((now, progress.time))
        begun, first = self._seen[0]
        done = progress.time - first
        return (progress.duration - progress.time) * (now - begun) / done if done > 0 else None


class Lines:
    """A callback that prints the first step, the last, and one every few seconds between them.

    Parameters
    ----------
    now : Callable
        A clock, without what the estimate of the time left shall not count [s].
    """

    def __init__(self, now: Callable[[], float] = perf_counter) -> None:
        self._now = now
        self._last = -SECONDS_BETWEEN_LINES
        self._pace = Pace()
        self._before: tuple[str, int] = ("", 0)

    def __call__(self, progress: "Progress") -> None:
        """Print the step where it is the first, the last, or some seconds after the one before."""
        now = self._now()
        if another_run(self._before, progress):
            self._last, self._pace = -SECONDS_BETWEEN_LINES, Pace()
        self._before = progress.stage, progress.step
        remaining = self._pace.left(now, progress)
        if progress.time < progress.duration and now - self._last < SECONDS_BETWEEN_LINES:
            return
        self._last = now
        most = "at most " * (progress.until_rest and progress.time < progress.duration)
        estimate = "" if remaining is None else f", {most}{clock(remaining)} left"
        print(
            f"{where(progress)} ({clock(progress.seconds)}{estimate}): {state(progress)}", file=sys.stderr, flush=True
        )


@contextmanager
def _bar(now: Callable[[], float] = perf_counter) -> "Iterator[Callable[[Progress], None]]":
    columns = (
        on_demand.TextColumn("{task.fields[where]}"),
        on_demand.BarColumn(bar_width=24),
        on_demand.TimeRemainingColumn(compact=True),
        on_demand.TextColumn("{task.fields[state]}"),
    )
    bar = on_demand.Bar(*columns, console=on_demand.Console(stderr=True), redirect_stdout=False, get_time=now)
    task = bar.add_task("", total=None, where="", state="")

    before = ("", 0)

    def listener(progress: "Progress") -> None:
        nonlocal before
        if another_run(before, progress):
            bar.reset(task)
        before = progress.stage, progress.step
        completed, total = progress.time, progress.duration
        bar.update(task, completed=completed, total=total, where=where(progress), state=state(progress))
        bar.start()  # with the first step, as the settings are printed before it

    try:
        yield listener
    finally:
        bar.stop()


def another_run(before: tuple[str, int], progress: "Progress") -> bool:
    """True for the first step of another run than that of `before`, a stage and a step: a fit has several."""
    stage, step = before
    return progress.stage != stage or progress.step < step


def where(progress: "Progress") -> str:
    """Stage, simulated time and duration."""
    stage = f"{progress.stage}: " if progress.stage else ""
    return f"{stage}{progress.time:.3f} of {progress.duration:g} s"


def state(progress: "Progress") -> str:
    """Iterations of the step, gap and verdict."""
    gap = length_text(progress.minimum_gap) if progress.minimum_gap < float("inf") else "-"
    return f"{progress.newton_iterations} Newton, gap {gap}, {progress.verdict}"


def clock(seconds: float) -> str:
    """A time in words.

    Examples
    --------
    >>> clock(3.21), clock(245), clock(7390)
    ('3.2 s', '4:05 min', '2:03:10 h')
    """
    if seconds < 60:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    if minutes < 60:
        return f"{minutes}:{rest:02d} min"
    return f"{minutes // 60}:{minutes % 60:02d}:{rest:02d} h"


def frame_counter(quiet: bool) -> Callable[[int, int], None]:
    """A callback that prints the number of the frame that is drawn; nothing where `quiet` or without a terminal."""

    def progress(done: int, total: int) -> None:
        if not quiet and sys.stderr.isatty():
            print(f"\rframe {done} of {total}", end="" if done < total else "\n", file=sys.stderr, flush=True)

    return progress


COMPILE = "numba:compile"
"""Numba's event around a compilation; a kernel that comes from the cache raises none."""

KERNELS = 63
"""Those of a drape on a body with self contact and friction, up to its picture (scenes/sphere.toml)."""

SECONDS = 40
"""Their compilation in two processes on two cores."""


class CompilationClock:
    """Listener of numba: sum of the seconds of compilation since it was installed, that under way included.

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

    def notify(self, event: Any) -> None:
        """Take an event of numba."""
        (self.on_start if event.is_start else self.on_end)(event)

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
    on_demand.Listener.register(CompilationClock)
    return on_demand.install_listener(COMPILE, CompilationClock())


@contextmanager
def compilation_notice(clock: CompilationClock) -> Iterator[Callable[[], object]]:
    """Print that kernels are compiled, how many and which, every few seconds until the yielded function is called.

    Nothing is printed where they are in the cache.
    """
    if engine.kernels_are_compiled():
        yield lambda: None
        return
    over, began, before = Event(), perf_counter(), on_demand.cached_kernels()
    print(f"compiling the kernels once, about {SECONDS} s; later runs find them compiled", file=sys.stderr, flush=True)

    def report() -> None:
        while not over.wait(SECONDS_BETWEEN_LINES):
            line = progress_text(on_demand.cached_kernels() - before, perf_counter() - began, clock.kernel)
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
