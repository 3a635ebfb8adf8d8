"""Force balance at the end of a solve: residual force against the largest force that acts.

Newton's step is the residual over the stiffness. Where a gap of 1e-13 m or a modulus of 1e20 Pa makes that huge, a step
is short long before forces balance, or no position that doubles can express balances them.
"""

from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.solve.linear.dependent_rows import NO_DEPENDENT_ROWS, DependentRows
from clothsim.solve.newton.potential import Potential

BALANCED = 0.3
"""Largest residual, relative to the force scale, of a balanced state. Of converged steps of a drape it was up to 5e-4
at a tolerance of 1e-3 m/s, .06 at .01 and .21 at .1; of unbalanced ones .6 to 1 (docs/notes/newton_stop.md).
"""
NO_FORCE_LEFT = 0.01
"""The same of a solve that cannot go on though its steps are short: with more, forces are why it fails."""
MOST_UNBALANCED = 20
"""Iterations with steps below the tolerance after which forces that do not balance end the solve."""


@dataclass(frozen=True)
class ForceBalance:
    """Residual force and force scale of a state [N].

    Parameters
    ----------
    residual : float
        Largest component of the total force on a free vertex.
    scale : float
        Largest component of the force of one energy on a vertex, gravity and inertia included, and the force that
        gives the heaviest vertex the tolerance as its speed within the step: what is below that is no imbalance.
    row : int
        Row of x with the residual.
    """

    residual: float
    scale: float
    row: int

    @property
    def relative(self) -> float:
        """Residual over force scale, 0 without any force."""
        return self.residual / self.scale if self.residual else 0.0

    def within(self, fraction: float) -> bool:
        """True where the residual is at most this fraction of the force scale."""
        return self.residual <= fraction * self.scale


def force_balance(
    potential: Potential,
    x: Floats,
    free: np.ndarray,
    least: float,
    dependent: DependentRows = NO_DEPENDENT_ROWS,
) -> ForceBalance:
    """Return the force balance at x.

    Parameters
    ----------
    potential : Potential
        Potential bound to the step.
    x : (N, 3) float64
        Positions [m].
    free : (n,) int64
        Rows of the free vertices.
    least : float
        Force that is no imbalance [N]; inf where masses are unknown.
    dependent : DependentRows
        Rows whose forces act on the unknowns that they follow.
    """
    largest = np.abs(dependent.reduced(potential.gradient(x))[free]).max(axis=1, initial=0.0)
    if not len(largest):
        return ForceBalance(0.0, least, 0)
    worst = int(largest.argmax())
    return ForceBalance(float(largest[worst]), potential.largest_force(x) + least, int(free[worst]))
