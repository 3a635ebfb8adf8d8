"""Difference formulas of a step: backward Euler, and BDF2 with variable steps (docs/theory.md#time-integration)."""

from dataclasses import dataclass

from clothsim.base.arrays import Floats
from clothsim.physics.energies.step import Past
from clothsim.solve.stepping.state import Previous, State

BACKWARD_EULER, BDF2 = "backward_euler", "bdf2"

LARGEST_RATIO = 2.4
"""Largest ratio of a step to the one before for BDF2, which is unstable from 1 + sqrt(2) on (Grigorieff 1983); backward
Euler steps there.
"""


@dataclass(frozen=True)
class Formula:
    """Difference formula v = (x - past.positions) / past.dt.

    Parameters
    ----------
    past : Past
        Weighted past positions (N, 3) [m], velocities [m/s] and length [s].
    order : int
        1 or 2.
    ratio : float
        h_n / h_(n-1); nan for a one-step formula.
    """

    past: Past
    order: int
    ratio: float = float("nan")

    def velocities(self, x: Floats) -> Floats:
        """Return v at the end of the step that ends at x (N, 3) [m/s]."""
        return (x - self.past.positions) / self.past.dt


def formula_of(integrator: str, state: State, h: float) -> Formula:
    """Return the formula of a step of length h [s] from `state`.

    BDF2 starts with a step of backward Euler: at the start, without a previous state, and after a step so short that
    the ratio would be LARGEST_RATIO or more.
    """
    before = state.previous
    if integrator == BDF2 and before is not None and h / before.dt < LARGEST_RATIO:
        ratio = h / before.dt
        return Formula(bdf2_past(state, before, h, ratio), 2, ratio)
    return Formula(Past(state.positions, state.velocities, h), 1)


def bdf2_past(state: State, before: Previous, h: float, r: float) -> Past:
    """Return x^ = ((1+r)^2 x_n - r^2 x_(n-1)) / (1+2r), v^ alike, and b h with b = (1+r) / (1+2r)."""
    new, old = (1 + r) ** 2 / (1 + 2 * r), r**2 / (1 + 2 * r)
    return Past(
        new * state.positions - old * before.positions,
        new * state.velocities - old * before.velocities,
        (1 + r) / (1 + 2 * r) * h,
    )
