"""The length of the steps, chosen so that their errors sum to what the user asked for."""

from dataclasses import dataclass

from clothsim.energies.step import CONTACT_TIME_SCALE
from clothsim.sim.state import State

SAFETY = 0.9
SMALLEST_FACTOR = 0.3
LARGEST_FACTOR = {1: 2.0, 2: 1.5}
"""By the order: BDF2 remembers a growth by r with the factor r^2/(1 + 2 r), .56 at 1.5 and .8 at 2."""
LEAST_FRACTION = 0.05
"""Of what is left of the error: so much one step may add, whatever its length. An impact changes a velocity by a jump,
and its error falls only with h, as does what a step may add in its time: no step would ever be short enough."""
LARGEST_RETRY = 0.7
MOST_STEPS = 100_000
"""No step is chosen shorter than the duration over this."""


@dataclass(frozen=True)
class ErrorControl:
    """error: what the steps of the whole run may add to the positions, as `step_error` has it (RMS) [m].

    duration of the run [s]; longest: a step may not be longer [s]. What is left of the error is shared out evenly over
    the time that is left (error per unit step: Shampine & Gordon 1975), so that half the error asked for is half the
    error of the run, with backward Euler for twice and with BDF2 for 1.4 times the steps.
    """

    error: float
    duration: float
    longest: float

    @property
    def shortest(self) -> float:
        """No step is chosen shorter [s]."""
        return min(self.longest, self.duration / MOST_STEPS)

    @property
    def contact_time_scale(self) -> float:
        """The time in which contact answers [s]: the same for each dt.

        Whatever touches would gain the energy of a barrier that becomes stiffer.
        """
        return min(self.longest, CONTACT_TIME_SCALE)

    def exceeds(self, state: State, h: float, error: float) -> bool:
        """Whether a step of length h [s] from `state` added too much `error` [m]."""
        return error > self._allowed(state, h)

    def retry(self, state: State, h: float, error: float) -> float:
        """The dt to try after h added too much [s]."""
        factor = (SAFETY * self._allowed(state, h) / error) ** 0.5
        return max(self.shortest, h * min(max(factor, SMALLEST_FACTOR), LARGEST_RETRY))

    def next_dt(self, after: State, h: float, error: float, order: int) -> float:
        """The dt of the step after one of length h [s] and `order`, whose end `after` counts its error [m]."""
        rate = self._left(after) / max(self.duration - after.time, h)
        most = LARGEST_FACTOR[order]
        factor = (SAFETY * rate * h / error) ** (1 / order) if error > 0 else most
        return max(self.shortest, min(self.longest, h * min(max(factor, SMALLEST_FACTOR), most)))

    def _allowed(self, state: State, h: float) -> float:
        return self._left(state) * max(h / (self.duration - state.time), LEAST_FRACTION)

    def _left(self, state: State) -> float:
        """What is left of the error [m]; once it is spent, a share of what an even use would have left."""
        even = self.error * (1 - state.time / self.duration)
        return max(self.error - state.temporal_error, LEAST_FRACTION * even)
