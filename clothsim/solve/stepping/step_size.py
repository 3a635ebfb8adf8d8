"""Step size control: steps whose local errors sum to the error that the user requested."""

from dataclasses import dataclass

from clothsim.physics.energies.step import CONTACT_TIME_SCALE
from clothsim.solve.stepping.state import State

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
    """

    error: float
    duration: float
    longest: float

    @property
    def shortest(self) -> float:
        """Shortest step [s]."""
        return min(self.longest, self.duration / MOST_STEPS)

    @property
    def contact_time_scale(self) -> float:
        """Contact time scale [s], the same for each dt.

        A barrier that became stiffer with a shorter dt would add energy to whatever is in contact.
        """
        return min(self.longest, CONTACT_TIME_SCALE)

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
