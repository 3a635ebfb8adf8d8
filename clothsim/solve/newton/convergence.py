"""Stopping rule of Newton's method: the balance of its error against the time error of the step.

A step of the time integrator is wrong by its local error, whatever Newton does. Iterations that change the result by
much less buy nothing; iterations left out add their error to it. Both errors enter the velocity alike, so that what is
balanced in each step stays balanced over a run (docs/notes/newton_stop.md).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats

LEAST_SPEED, MOST_SPEED = 1e-2, 0.3
"""Bounds of the balanced stop on |dx|_inf / dt, over the fraction of the time error [m/s].

At a fraction of .1, a step below .001 m/s ends the solve whatever the time error, which vanishes at rest, and none
above .03 m/s does, where the time error is large: at the start, or with a dt of seconds.
"""

FIRST_FORCE = 0.1
"""Residual over the force scale, over the fraction of the time error, after a solve of one step: 1 % at a fraction of
.1. A card that is about to slip is held, 2 to 8 % out of balance, by a first step of which the next is a hundredfold.
"""

TimeError = Callable[[Floats], tuple[float, float]]
"""Local time error of a step that ends at x (N, 3): root mean square over the cloth vertices, and the largest [m]."""


def no_time_error(x: Floats) -> tuple[float, float]:
    """Return the time error of a quasi-static step, 0."""
    return 0.0, 0.0


@dataclass(frozen=True)
class ErrorBalance:
    """Newton's error as a fraction of the time error of the step.

    Parameters
    ----------
    fraction : float
        Fraction of the time error that Newton may leave; 0: the tolerance alone ends a solve.
    count : int
        Number of cloth vertices, the first rows of x.
    time_error : callable
        Time error of the step at its end.
    """

    fraction: float = 0.0
    count: int = 0
    time_error: TimeError = no_time_error

    def allowed(self, x: Floats) -> tuple[float, float]:
        """Return what Newton may leave at the end x (N, 3) of a step: root mean square and largest [m]."""
        rms, largest = self.time_error(x)
        return self.fraction * rms, self.fraction * largest

    def reached(self, x: Floats, dx: Floats, lengths: tuple[float, float], dt: float) -> bool:
        """True where the change that remains at x is predicted to be below the allowed one.

        Parameters
        ----------
        x, dx : (N, 3) float64
            Positions and the Newton step from them, unclipped and along positive curvature [m].
        lengths : tuple of float
            Root mean squares of this step and of the one before [m]; inf where it predicts nothing.
        dt : float
            Length of the time step [s].
        """
        largest = largest_step(dx)
        if not self.fraction or largest > self.most(dt):
            return False
        allowed_rms, allowed_largest = self.allowed(x + dx)
        return remaining_change(*lengths) < allowed_rms and largest < allowed_largest

    def force_fraction(self, first: bool, without: float) -> float:
        """Residual over the force scale to which forces must balance.

        first: after the first step of a solve; without: the fraction where the tolerance alone ends a solve.
        """
        if not self.fraction:
            return without
        return (FIRST_FORCE if first else 1.0) * min(self.fraction, without)

    def most(self, dt: float) -> float:
        """Return the longest displacement of a vertex that may end a solve [m]."""
        return MOST_SPEED * self.fraction * dt

    def rms(self, dx: Floats) -> float:
        """Return the root mean square of a step over the cloth vertices [m].

        Plain, not weighted by mass: the local error of a step is (`StepError`), and like is compared with like.
        """
        return float(np.sqrt((dx[: self.count] ** 2).sum() / max(self.count, 1)))


def remaining_change(step: float, before: float) -> float:
    """Predict the distance to the minimiser from the lengths of the last two Newton steps.

    The last step itself, or the sum of the geometric series that its ratio to the one before begins, where that is
    longer. Steps that grow predict nothing (inf), and so does one alone: where friction sticks the first step is a
    hundredth of those that follow once it slips.

    Examples
    --------
    >>> remaining_change(1.0, 10.0), remaining_change(3.0, 4.0), remaining_change(2.0, 1.0)
    (1.0, 9.0, inf)
    """
    if step >= before or not np.isfinite(before):
        return np.inf
    rate = step / before
    return step * max(1.0, rate / (1.0 - rate))


def largest_step(dx: Floats) -> float:
    """Return the largest component of a step [m]."""
    return float(np.abs(dx).max(initial=0.0))
