"""The receipt: what each effect and each phase of a step was called for, and how long it took."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from time import perf_counter


@dataclass
class Account:
    """Counters of one effect, or seconds of one phase."""

    seconds: float = 0.0
    evaluations: int = 0
    gradients: int = 0
    hessians: int = 0
    pairs: int = 0
    ccd_calls: int = 0


@dataclass
class Ledger:
    """Accounts by name. `effects`: what the scene named; `phases`: assembly, linear solve, ...; both in seconds.

    It only counts: nothing computed may depend on it.
    """

    effects: dict[str, Account] = field(default_factory=dict)
    phases: dict[str, float] = field(default_factory=dict)
    linear_solves: int = 0

    @contextmanager
    def effect(self, name: str, counter: str) -> Iterator[Account]:
        """Time one call of an effect and count it under `counter`."""
        account = self.effects.setdefault(name, Account())
        start = perf_counter()
        try:
            yield account
        finally:
            account.seconds += perf_counter() - start
            if counter:
                setattr(account, counter, getattr(account, counter) + 1)

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Time a phase that belongs to no effect."""
        start = perf_counter()
        try:
            yield
        finally:
            self.phases[name] = self.phases.get(name, 0.0) + perf_counter() - start
