"""Timers and counters of each effect and of each phase of a step, in CPU seconds of the thread that does the work."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from time import thread_time


@dataclass
class EffectCounters:
    """Counters of one effect.

    Parameters
    ----------
    seconds : float
        All of its time.
    evaluations, gradients, hessians, ccd_calls : int
        Calls.
    pairs : int
        Contact pairs in the current step.
    hessian_nonzeros : int
        Numbers in its last Hessian.
    steps : int
        Calls of `begin`, failed tries of a step included.
    idle_steps : int
        Those of them in which it had nothing to do.
    parts : dict
        Seconds of named searches, included in `seconds`.
    """

    seconds: float = 0.0
    evaluations: int = 0
    gradients: int = 0
    hessians: int = 0
    pairs: int = 0
    ccd_calls: int = 0
    hessian_nonzeros: int = 0
    steps: int = 0
    idle_steps: int = 0
    parts: dict[str, float] = field(default_factory=dict)


class _Call:
    """Timer of one effect call; a class, as a generator-based context manager is too slow for 60 calls an iteration."""

    __slots__ = ("counter", "counters", "start", "timers")

    def __init__(self, timers: "Timers", counters: EffectCounters, counter: str) -> None:
        self.timers, self.counters, self.counter = timers, counters, counter

    def __enter__(self) -> EffectCounters:
        self.start = self.timers._open()
        return self.counters

    def __exit__(self, *failure: object) -> None:
        counters, counter = self.counters, self.counter
        own = self.timers._close(self.start)
        with self.timers._lock:
            counters.seconds += own
            if counter:
                setattr(counters, counter, getattr(counters, counter) + 1)


class _Inside(threading.local):
    """For each open measurement of a thread the seconds that nested ones have been charged."""

    def __init__(self) -> None:
        self.charged: list[float] = []


@dataclass
class Timers:
    """Timers by name. `effects`: those that the scene names; `phases`: assembly, linear solve, ... [s].

    Every second is counted once: a phase that calls effects (the line search) is charged its own time only, so effects
    and phases add up to the time measured, on several threads to the sum of theirs. No computed number depends on them.
    """

    effects: dict[str, EffectCounters] = field(default_factory=dict)
    phases: dict[str, float] = field(default_factory=dict)
    linear_solves: int = 0
    elimination_seconds: float = 0.0
    """Seconds spent on nonlinear elimination; they are counted under effects and phases too."""
    _open_measurements: "_Inside" = field(default_factory=_Inside, repr=False)
    _lock: threading.Lock = field(default_factory=threading.Lock, repr=False)

    def effect(self, name: str, counter: str) -> "_Call":
        """Time one call of an effect and count it under `counter`."""
        counters = self.effects.get(name)
        if counters is None:
            counters = self.effects[name] = EffectCounters()
        return _Call(self, counters, counter)

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Time a phase that belongs to no effect."""
        start = self._open()
        try:
            yield
        finally:
            own = self._close(start)
            with self._lock:
                self.phases[name] = self.phases.get(name, 0.0) + own

    @contextmanager
    def patch(self) -> Iterator[None]:
        """Time a solve on a patch, beside its effects and phases."""
        start = thread_time()
        yield
        self.elimination_seconds += thread_time() - start

    def _open(self) -> float:
        self._open_measurements.charged.append(0.0)
        return thread_time()

    def _close(self, start: float) -> float:
        """Seconds since `start`, less those charged to nested measurements."""
        elapsed = thread_time() - start
        inside = self._open_measurements.charged
        own = elapsed - inside.pop()
        if inside:
            inside[-1] += elapsed
        return own
