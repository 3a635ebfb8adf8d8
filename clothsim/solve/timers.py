"""Timers and counters of each effect and of each phase of a step, in CPU seconds of the thread that does the work."""

import threading
from collections.abc import Iterable, Iterator
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


class _Inside(threading.local):
    """For each open measurement of a thread the seconds that nested ones have been charged."""

    def __init__(self) -> None:
        self.charged: list[float] = []


class _Measurement:
    """An open measurement; a class, as a generator-based context manager is too slow for 60 of them an iteration.

    The clock is a system call of a microsecond: it is read once at each border.
    """

    __slots__ = ("charged", "start", "timers")

    def __init__(self, timers: "Timers") -> None:
        self.timers, self.charged = timers, timers._inside.charged

    def open(self) -> None:
        """Begin."""
        self.charged.append(0.0)
        self.start = thread_time()

    def close(self) -> float:
        """Seconds since `open`, less those charged to nested measurements."""
        elapsed = thread_time() - self.start
        own = elapsed - self.charged.pop()
        if self.charged:
            self.charged[-1] += elapsed
        return own


class _Call(_Measurement):
    """One call of an effect."""

    __slots__ = ("counter", "name")

    def __init__(self, timers: "Timers", name: str, counter: str) -> None:
        super().__init__(timers)
        self.name, self.counter = name, counter

    def __enter__(self) -> None:
        self.open()

    def __exit__(self, *failure: object) -> None:
        self.timers.charge(((self.name, self.counter, self.close()),))


class _Phase(_Measurement):
    """A phase that belongs to no effect."""

    __slots__ = ("name",)

    def __init__(self, timers: "Timers", name: str) -> None:
        super().__init__(timers)
        self.name = name

    def __enter__(self) -> None:
        self.open()

    def __exit__(self, *failure: object) -> None:
        own, phases = self.close(), self.timers.phases
        with self.timers._lock:
            phases[self.name] = phases.get(self.name, 0.0) + own


class EffectsInTurn(_Measurement):
    """Calls of one effect after the other, each charged the time since the one before, all of them at the end."""

    __slots__ = ("before", "calls")

    def __enter__(self) -> "EffectsInTurn":
        self.open()
        self.before = self.start
        self.calls: list[tuple[str, str, float]] = []
        return self

    def done(self, name: str, counter: str) -> None:
        """Charge an effect with what was done since the last call."""
        now, charged = thread_time(), self.charged
        self.calls.append((name, counter, now - self.before - charged[-1]))
        self.before, charged[-1] = now, 0.0

    def __exit__(self, *failure: object) -> None:
        self.timers.charge(self.calls)
        inside = self.charged.pop()  # since the last border, where an error ended the call
        if self.charged:
            self.charged[-1] += self.before - self.start + inside


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
    _inside: _Inside = field(default_factory=_Inside, repr=False)
    _lock: threading.Lock = field(default_factory=threading.Lock, repr=False)

    def effect(self, name: str, counter: str) -> _Call:
        """Time one call of an effect and count it under `counter`."""
        return _Call(self, name, counter)

    def effects_in_turn(self) -> EffectsInTurn:
        """Time calls of effects that follow one another: `done` ends each of them."""
        return EffectsInTurn(self)

    def phase(self, name: str) -> _Phase:
        """Time a phase that belongs to no effect."""
        return _Phase(self, name)

    def account(self, name: str) -> EffectCounters:
        """Return the counters of an effect, at 0 where it has none yet."""
        known = self.effects.get(name)
        return self.effects.setdefault(name, EffectCounters()) if known is None else known

    def charge(self, calls: Iterable[tuple[str, str, float]]) -> None:
        """Add the seconds of calls to their effects, and count each under its counter where that has a name."""
        with self._lock:
            for name, counter, seconds in calls:
                counters = self.effects.get(name) or self.account(name)
                counters.seconds += seconds
                if counter:
                    setattr(counters, counter, getattr(counters, counter) + 1)

    @contextmanager
    def patch(self) -> Iterator[None]:
        """Time a solve on a patch, beside its effects and phases."""
        start = thread_time()
        yield
        self.elimination_seconds += thread_time() - start
