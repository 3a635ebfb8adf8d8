"""Gauss and Newton's method over few numbers of which each evaluation is a run.

Along one direction, steps double and parabolas end the search: small steps of a garment on a body change its buckles at
random, and a derivative says little there.

The derivatives of the positions by the numbers are differences of runs at first, and then follow the steps by Broyden's
update (Broyden 1965, "A class of methods for solving nonlinear simultaneous equations"); before the end they are
differences again.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import ClothsimError

MOST_ITERATIONS = 10
"""Steps of one start."""
HALVINGS = 3
"""Of a step that does not reduce the sum."""
VERTICES = 6
"""Runs along a direction after its steps have doubled."""
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
    both_sides : bool
        Take each difference to both sides and count the smaller one: the other may be a jump between branches.
    most : int
        Bound on the steps.
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
    both_sides: bool = False
    most: int = MOST_ITERATIONS

    def moves(self, seen: S) -> Floats:
        """Derivatives of the positions by the numbers, (p, k), by differences. ClothsimError where runs fail."""
        columns = []
        for k, step in enumerate(self.steps):
            sides: list[Floats] = []
            for sign in (1.0, -1.0):  # a run may fail on one side
                if sides and not self.both_sides:
                    break
                beside = self.beside(seen.at + sign * step * np.eye(len(self.steps))[k], seen)
                self.tell(beside)
                if np.isfinite(beside.total):
                    sides.append((beside.positions - seen.positions).ravel() / (sign * step))
            if not sides:
                why = f"The runs beside those of the numbers {seen.at.tolist()} fail: {beside.failure}"
                raise ClothsimError(why, f"Leave out the number {k}, counted from 0, or start from other numbers.")
            columns.append(min(sides, key=lambda side: float(side @ side)))
        return np.array(columns).T

    def descended(self, seen: S, moves: Floats | None = None) -> tuple[S, S, Floats, int]:
        """The last run of a start, the one before it, the derivatives at the last, and the number of runs.

        moves: derivatives at `seen`, where they are known.
        """
        k = len(seen.at) * (2 if self.both_sides else 1)
        runs, fresh, before = 1 if moves is not None else k + 1, True, seen
        moves = self.moves(seen) if moves is None else moves
        for _ in range(self.most):
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


@dataclass(frozen=True, eq=False)
class LineSearch(Generic[S]):
    """Runs along a direction, by how far they are along it.

    Parameters
    ----------
    run : callable
        The run at a place along it.
    runs : dict
        Those that were taken, by their place; the one at 0 to begin with.
    step, limit : float
        The first step, and the farthest place.
    enough : callable
        True of a run that none lower is sought than.
    """

    run: Callable[[float], S]
    runs: dict[float, S]
    step: float
    limit: float
    enough: Callable[[S], bool] = lambda seen: False

    @property
    def lowest(self) -> S:
        """The run with the lowest sum."""
        return min(self.runs.values(), key=lambda seen: seen.total)

    def begin(self) -> float:
        """Take the first step, and one to the other side where it is not lower; the step that was taken last."""
        step = self.step
        if self._total(step) >= self.runs[0.0].total:
            step = -step
            self._total(step)
        return step

    def double(self) -> None:
        """Begin, and double the step while the sum falls, within the limit."""
        step, lowest = self.begin(), self.runs[0.0].total
        while self.runs[step].total < lowest and abs(step) <= 0.5 * self.limit:
            lowest, step = self.runs[step].total, 2 * step
            self._total(step)

    def refined(self) -> S:
        """The lowest run after those at vertices of parabolas."""
        for count in range(VERTICES):
            places = sorted((q, seen.total) for q, seen in self.runs.items())
            k = int(np.argmin([total for _, total in places]))
            around = places[max(k - 1, 0) : k + 2]
            poor = count > 0 and places[k][0] == 0.0  # nothing along it is lower than the first run
            if poor or len(around) < 3 or self.enough(self.lowest):
                break
            self._total(vertex(around))
        return self.lowest

    def _total(self, q: float) -> float:
        """The sum at a place, whose run is taken once."""
        if q not in self.runs:
            self.runs[q] = self.run(q)
        return self.runs[q].total


def vertex(places: Sequence[tuple[float, float]]) -> float:
    """Where a parabola through three totals is lowest, of which the middle one is the lowest.

    Between the outer ones, and no nearer to the middle one than a tenth of the way to its farther neighbour; half that
    way where a total is infinite.

    Examples
    --------
    >>> round(vertex([(q, (q - 2.0) ** 2) for q in (0, 1.5, 3)]), 9)
    2.0
    """
    q, totals = np.array(places).T
    farther = q[0] if q[1] - q[0] > q[2] - q[1] else q[2]
    if not np.isfinite(totals).all():
        return float(0.5 * (q[1] + farther))
    bend, tilt, _ = np.polyfit(q, totals, 2)  # of totals that agree to rounding, any parabola
    lowest = float(np.clip(-0.5 * tilt / bend, q[0], q[2])) if bend > 0 else float(q[1])
    least = 0.1 * (farther - q[1])
    return lowest if abs(lowest - q[1]) >= abs(least) else float(q[1] + least)
