"""The receipt: what each effect and each phase of a step was called for, and how long it took."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from time import perf_counter


@dataclass
class EffectCounters:
    """Counters of one effect. seconds: all of its time; parts: those of them that went into named searches.

    pairs: how many it acts on now; hessian_nonzeros: numbers in the Hessian that it handed over last. steps: how often
    it was bound to a step, a try that failed too; idle_steps: in how many of them it had nothing to do at the start.
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
    """One call of an effect, timed inside `with`: at 60 an iteration a generator made into a context tells."""

    __slots__ = ("account", "counter", "start", "timers")

    def __init__(self, timers: "Timers", account: EffectCounters, counter: str) -> None:
        self.timers, self.account, self.counter = timers, account, counter

    def __enter__(self) -> EffectCounters:
        self.start = self.timers._open()
        return self.account

    def __exit__(self, *failure: object) -> None:
        account, counter = self.account, self.counter
        account.seconds += self.timers._close(self.start)
        if counter:
            setattr(account, counter, getattr(account, counter) + 1)


@dataclass
class Timers:
    """Accounts by name. `effects`: what the scene named; `phases`: assembly, linear solve, ...; both in seconds.

    Every second is booked once: a phase that calls effects (the line search) is charged for what it does itself, so
    effects and phases add up to the time measured. It only counts: nothing computed may depend on it.
    """

    effects: dict[str, EffectCounters] = field(default_factory=dict)
    phases: dict[str, float] = field(default_factory=dict)
    linear_solves: int = 0
    elimination_seconds: float = 0.0
    """Seconds spent on regions; they are in the accounts, too."""
    _inside: list[float] = field(default_factory=list, repr=False)
    """For each open measurement the seconds that others inside it have booked."""

    def effect(self, name: str, counter: str) -> "_Call":
        """Time one call of an effect and count it under `counter`."""
        account = self.effects.get(name)
        if account is None:
            account = self.effects[name] = EffectCounters()
        return _Call(self, account, counter)

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Time a phase that belongs to no effect."""
        start = self._open()
        try:
            yield
        finally:
            self.phases[name] = self.phases.get(name, 0.0) + self._close(start)

    @contextmanager
    def patch(self) -> Iterator[None]:
        """Time a solve of a region: once more, beside what its parts book."""
        start = perf_counter()
        yield
        self.elimination_seconds += perf_counter() - start

    def _open(self) -> float:
        self._inside.append(0.0)
        return perf_counter()

    def _close(self, start: float) -> float:
        """The seconds since `start`, less those that were booked inside."""
        elapsed = perf_counter() - start
        own = elapsed - self._inside.pop()
        if self._inside:
            self._inside[-1] += elapsed
        return own
