"""Local truncation error of a step: its estimate from the velocities (Milne), its balance, and the step size."""

from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.vectors import lengths as lengths_of
from clothsim.mesh.world import World
from clothsim.physics.energies.base import CONTACT_TIME_SCALE
from clothsim.solve.newton.convergence import ErrorBalance, MotionStop
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
    lengths = VELOCITY_ERROR_FACTOR * h / (formula.order + 1) * lengths_of(change)
    lengths[held] = 0.0
    if integrator == BDF2 and formula.order == 1:
        lengths *= STARTUP_FACTOR
    return lengths


# Time error of a step as Newton's method sees it, for the balance of both errors.


def error_balance(
    fraction: float, integrator: str, formula: Formula, before: State, count: int, h: float, held: Ints
) -> ErrorBalance:
    """Return the balance of Newton's error against the local error of a step of length h [s].

    The error is that of the positions at the end of this step, by `step_error` without the factor for what velocities
    add later: Newton's error enters the velocities too.

    Parameters
    ----------
    fraction : float
        Fraction of the time error that Newton may leave.
    integrator : str
        "backward_euler" or "bdf2".
    formula : Formula
        Formula of the step.
    before : State
        Start of the step.
    count : int
        Number of cloth vertices.
    held : (k,) int64
        Prescribed rows, which have no error.
    """

    def time_error(x: Floats) -> tuple[float, float]:
        error = step_error(integrator, formula, before, formula.velocities(x)[:count], h, held)
        return error.rms / VELOCITY_ERROR_FACTOR, error.largest / VELOCITY_ERROR_FACTOR

    return ErrorBalance(fraction, count, time_error)


def motion_stop(
    fraction: float,
    least: float,
    integrator: str,
    formula: Formula,
    world: World,
    before: State,
    h: float,
    held: Ints,
) -> MotionStop:
    """Return the stop by the motion of a step of length h [s].

    Parameters
    ----------
    fraction : float
        Fraction of the time error that the last Newton step may have.
    least : float
        Root mean square of a step that ends a solve whatever the time error [m].
    integrator, formula, before, held
        As of `error_balance`.
    world : World
        Meshes.
    """
    bodies = (*world.cloth_slices, *world.coordinate_slices)

    def time_errors(x: Floats) -> Floats:
        after = formula.velocities(x)[: world.n_unknowns]
        lengths = vertex_errors(integrator, formula, before, after, h, held) / VELOCITY_ERROR_FACTOR
        return np.array([np.sqrt((lengths[rows] ** 2).mean()) for rows in bodies])

    return MotionStop(fraction, bodies, time_errors, world.cell, least)


# Step size control: steps whose local errors sum to the error that the user requested.


SAFETY = 0.9
SMALLEST_FACTOR = 0.3
LARGEST_FACTOR = {1: 2.0, 2: 1.5}
"""Largest growth of a step, by the order: BDF2 amplifies a growth by r with r^2/(1 + 2 r), .56 at 1.5 and .8 at 2."""
LEAST_FRACTION = 0.05
"""Fraction of the remaining error that one step may add, whatever its length. An impact changes a velocity by a jump,
and its error falls only with h, as does what a step may add in its time: no step would ever be short enough.
"""
LARGEST_RETRY = 0.7
MOST_STEPS = 100_000
"""Bound on the number of steps: none is chosen shorter than the duration over this."""


@dataclass(frozen=True)
class ErrorControl:
    """Error per unit step control (Shampine & Gordon 1975).

    The remaining error is spread evenly over the remaining time, so that half the requested error is half the error of
    the run, with backward Euler for twice and with BDF2 for 1.4 times the steps.

    Parameters
    ----------
    error : float
        Requested bound on the sum of the local errors, by `step_error` (RMS) [m].
    duration : float
        Duration of the run [s].
    longest : float
        Longest step [s].
    contact_time : float
        Contact time of the scene [s].
    """

    error: float
    duration: float
    longest: float
    contact_time: float = CONTACT_TIME_SCALE

    @property
    def shortest(self) -> float:
        """Shortest step [s]."""
        return min(self.longest, self.duration / MOST_STEPS)

    @property
    def contact_time_scale(self) -> float:
        """Contact time scale [s], the same for each dt.

        A barrier that became stiffer with a shorter dt would add energy to whatever is in contact.
        """
        return min(self.longest, self.contact_time)

    def exceeds(self, state: State, h: float, error: float) -> bool:
        """True where a step of length h [s] from `state` added too much `error` [m]."""
        return error > self._allowed(state, h)

    def retry(self, state: State, h: float, error: float) -> float:
        """Return the dt to try after h added too much [s]."""
        factor = (SAFETY * self._allowed(state, h) / error) ** 0.5
        return max(self.shortest, h * min(max(factor, SMALLEST_FACTOR), LARGEST_RETRY))

    def next_dt(self, after: State, h: float, error: float, order: int) -> float:
        """Return the dt after a step of length h [s] and `order`, whose end `after` includes its error [m]."""
        rate = self._remaining(after) / max(self.duration - after.time, h)
        most = LARGEST_FACTOR[order]
        factor = (SAFETY * rate * h / error) ** (1 / order) if error > 0 else most
        return max(self.shortest, min(self.longest, h * min(max(factor, SMALLEST_FACTOR), most)))

    def _allowed(self, state: State, h: float) -> float:
        return self._remaining(state) * max(h / (self.duration - state.time), LEAST_FRACTION)

    def _remaining(self, state: State) -> float:
        """Remaining error [m]; once it is spent, a fraction of what an even use would leave."""
        even = self.error * (1 - state.time / self.duration)
        return max(self.error - state.temporal_error, LEAST_FRACTION * even)
