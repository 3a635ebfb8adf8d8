"""Rest angles along creases, constant or over time."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from clothsim.energies.protocols import Driven
from clothsim.energies.shifted_hinges import ShiftedHinges
from clothsim.energies.step import Step
from clothsim.energies.varying_values import Schedule
from clothsim.errors import InputError


@dataclass(frozen=True)
class RestAngle(ShiftedHinges, Driven):
    """Shifted rest angles along creases.

    Parameters
    ----------
    schedules : tuple of Schedule
        Rest angle of each crease [degrees].
    counts_of_hinges : tuple of int
        Number of hinges along each crease.
    """

    schedules: tuple[Schedule, ...]
    counts_of_hinges: tuple[int, ...]

    @property
    def drives(self) -> bool:
        """True where a rest angle varies over time, which does external work."""
        return not all(angle.is_constant for angle in self.schedules)

    def begin(self, step: Step) -> Self:
        """A copy with the rest angles of the end of the step; a quasi-static ramp scales constant ones."""
        now = step.time + step.dt
        goals = np.repeat([radians(angle, now) for angle in self.schedules], self.counts_of_hinges)
        loads = np.repeat([step.load if a.is_constant else 1.0 for a in self.schedules], self.counts_of_hinges)
        return replace(self, shifts=loads * (goals - self.references))


def radians(angle: Schedule, time: float) -> float:
    """The rest angle at `time` [s] in radians. InputError for half a turn and more."""
    degrees = angle.at(time)
    if not abs(degrees) < 180:
        raise InputError(f"{angle.name} is {degrees:g} at {time:g} s.", "Give less than 180 degrees.")
    return float(np.radians(degrees))
