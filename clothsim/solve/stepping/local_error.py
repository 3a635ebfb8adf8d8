"""Local truncation error of a step, estimated from the velocities (Milne)."""

from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.solve.stepping.integrators import BDF2, Formula
from clothsim.solve.stepping.state import State

VELOCITY_ERROR_FACTOR = 2.0
"""Factor for the errors of the velocities, which become errors of position later: in a harmonic oscillation the largest
error is pi/2 times the sum of the local errors of the positions, in a double pendulum twice. In free fall none does:
the sum is twice the error.
"""

STARTUP_FACTOR = 1.5
"""Factor for the error of BDF2's first step, one of backward Euler: its second root, 1/3, sums to 3/2 with equal steps
(free fall ends 3/4 g h^2 low, not 1/2 g h^2).
"""


@dataclass(frozen=True)
class StepError:
    """Local error of the positions: root mean square over all cloth vertices, and the largest [m]."""

    rms: float
    largest: float


def step_error(integrator: str, formula: Formula, before: State, after: Floats, h: float, held: Ints) -> StepError:
    """Estimate the local error of a step of length h [s]; parameters as of `vertex_errors`."""
    lengths = vertex_errors(integrator, formula, before, after, h, held)
    return StepError(float(np.sqrt((lengths**2).mean())), float(lengths.max()))


def vertex_errors(integrator: str, formula: Formula, before: State, after: Floats, h: float, held: Ints) -> Floats:
    """Estimate the local error of a step of length h [s] at each vertex, (n,) [m].

    With p the order, e = VELOCITY_ERROR_FACTOR h |v(n+1) - v*| / (p + 1), where v* extrapolates the velocities of the
    last p steps: v_n for backward Euler (h/2 |dv| is h^2/2 |a|), v_n + r (v_n - v(n-1)) for BDF2 (with equal steps
    h^3/3 |d3x/dt3|). BDF's difference quotient is wrong by tau = h^p d(p+1)x/dt(p+1) / (p+1), and h tau goes into x
    (Hairer, Norsett & Wanner, Solving ODEs I, III.2: error constant 1/(p+1)); v(n+1) - v* is Milne's device on the
    velocities, which are smooth where positions differ from their integral by an error of the same order.

    Parameters
    ----------
    integrator : str
        "backward_euler" or "bdf2".
    formula : Formula
        Formula of the step.
    before : State
        Start of the step.
    after : (n, 3) float64
        Velocities of the cloths at its end [m/s].
    held : (k,) int64
        Prescribed rows, which have no error.
    """
    change = after - before.velocities[: len(after)]
    if formula.order == 2 and before.previous is not None:
        last_change = before.velocities[: len(after)] - before.previous.velocities[: len(after)]
        change = change - formula.ratio * last_change
    lengths = VELOCITY_ERROR_FACTOR * h / (formula.order + 1) * np.linalg.norm(change, axis=1)
    lengths[held] = 0.0
    if integrator == BDF2 and formula.order == 1:
        lengths *= STARTUP_FACTOR
    return lengths
