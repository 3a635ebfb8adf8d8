"""Gauss and Newton's method over few numbers of which each evaluation is a run.

The derivatives of the positions by the numbers are differences of runs at first, and then follow the steps by Broyden's
update (Broyden 1965, "A class of methods for solving nonlinear simultaneous equations"); before the end they are
differences again.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import ClothsimError

MOST_ITERATIONS = 10
"""Steps of one start."""
HALVINGS = 3
"""Of a step that does not reduce the sum."""
ENOUGH = 0.5
"""Length of a step in standard errors, and drop of the sum, at which the search ends."""


class TrialRun(Protocol):
    """A run with the sum that is minimised.

    at: numbers (k,); total: the sum, inf where the run failed; positions: what the sum is of, empty where it failed;
    failure: why it did.
    """

    @property
    def at(self) -> Floats: ...  # noqa: D102
    @property
    def total(self) -> float: ...  # noqa: D102
    @property
    def positions(self) -> Floats: ...  # noqa: D102
    @property
    def failure(self) -> str: ...  # noqa: D102


S = TypeVar("S", bound=TrialRun)


def halved_until_lower(
    run: Callable[[Floats, S], S], seen: S, step: Floats, tell: Callable[[S], None]
) -> tuple[S | None, int]:
    """The first run of the step, its half, ... that is lower than `seen`, None after HALVINGS; and the runs taken."""
    for halving in range(HALVINGS + 1):
        trial = run(seen.at + 0.5**halving * step, seen)
        tell(trial)
        if trial.total < seen.total:
            return trial, halving + 1
    return None, HALVINGS + 1


def broyden_update(moves: Floats, before: S, after: S) -> Floats:
    """Derivatives (p, k) that give the change of the positions from one outcome to the next, closest to `moves`.

    J + (y - J s) s' / s's (Broyden 1965, equation 4.5).
    """
    moved = after.at - before.at
    secant = (after.positions - before.positions).ravel() - moves @ moved
    return np.asarray(moves + np.outer(secant, moved) / (moved @ moved), np.float64)


@dataclass(frozen=True, eq=False)
class GaussNewton(Generic[S]):
    """A sum over numbers, and how it is searched.

    Parameters
    ----------
    run, beside : callable
        Numbers (k,) and the outcome that they follow to their run: of a step, and of a difference.
    linearised : callable
        An outcome and derivatives of its positions (p, k) to the gradient (k,) and the Hessian (k, k) of the sum.
    steps, largest, low, high : (k,) ndarray
        Differences that are taken, largest steps, and limits of the numbers.
    tell : callable
        Called with each run.
    least : float
        Drop of the sum, relative to it, at which the search ends too, with the derivatives that it has.
    """

    run: Callable[[Floats, S], S]
    beside: Callable[[Floats, S], S]
    linearised: Callable[[S, Floats], tuple[Floats, Floats]]
    steps: Floats
    largest: Floats
    low: Floats
    high: Floats
    tell: Callable[[S], None] = lambda seen: None
    least: float = 0.0

    def moves(self, seen: S) -> Floats:
        """Derivatives of the positions by the numbers, (p, k), by differences. ClothsimError where runs fail."""
        columns = []
        for k, step in enumerate(self.steps):
            for sign in (1.0, -1.0):  # a run may fail on one side
                beside = self.beside(seen.at + sign * step * np.eye(len(self.steps))[k], seen)
                self.tell(beside)
                if np.isfinite(beside.total):
                    columns.append((beside.positions - seen.positions).ravel() / (sign * step))
                    break
            else:
                why = f"The runs beside those of the numbers {seen.at.tolist()} fail: {beside.failure}"
                raise ClothsimError(why, f"Leave out the number {k}, counted from 0, or start from other numbers.")
        return np.array(columns).T

    def descended(self, seen: S, moves: Floats | None = None) -> tuple[S, S, Floats, int]:
        """The last run of a start, the one before it, the derivatives at the last, and the number of runs.

        moves: derivatives at `seen`, where they are known.
        """
        k = len(seen.at)
        runs, fresh, before = 1 if moves is not None else k + 1, True, seen
        moves = self.moves(seen) if moves is None else moves
        for _ in range(MOST_ITERATIONS):
            gradient, hessian = self.linearised(seen, moves)
            step: Floats = -np.asarray(np.linalg.lstsq(hessian, gradient, rcond=1e-12)[0], np.float64)
            step *= min(1.0, float((self.largest / np.maximum(np.abs(step), 1e-12)).min()))
            step = np.clip(seen.at + step, self.low, self.high) - seen.at
            done = float(step @ hessian @ step) < max(ENOUGH**2, self.least * seen.total)
            better, tried = (None, 0) if done else halved_until_lower(self.run, seen, step, self.tell)
            runs += tried
            if better is not None:
                moves = broyden_update(moves, seen, better)
                gain, before, seen = seen.total - better.total, seen, better
                if fresh and gain < self.least * seen.total:
                    break  # derivatives of the end would give no more
                fresh, done = False, gain < ENOUGH
            if better is None or done:
                if fresh:
                    break
                moves, fresh, runs = self.moves(seen), True, runs + k
        if not fresh:
            moves, runs = self.moves(seen), runs + k
        return seen, before, moves, runs
