"""Rest angles along creases, constant or over time.

With the shifts s of the rest angles and the bending energy (theta - theta0)' K (theta - theta0)/2 the moments are K s
(`hinge_moments`): in the mid-edge model those of the hinges around a crease too.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from scipy import sparse

from clothsim.base.arrays import Ints
from clothsim.base.errors import InputError
from clothsim.base.linalg import dot
from clothsim.physics.energies.hinge_moments import BendingModel, ShiftedAngles
from clothsim.physics.energies.protocols import Driven
from clothsim.physics.energies.step import Step
from clothsim.physics.energies.varying_values import Schedule


@dataclass(frozen=True)
class RestAngleEnergy(ShiftedAngles, Driven):
    """Shifted rest angles along creases.

    Parameters
    ----------
    stiffness : (h, k) sparse array
        Columns of K [N m].
    schedules : tuple of Schedule
        Rest angle of each crease [degrees].
    counts_of_hinges : tuple of int
        Number of hinges along each crease.
    """

    stiffness: sparse.csr_array
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
        shifts = loads * (goals - self.references[: len(goals)])
        moments = self.stiffness @ shifts
        return replace(self, shifts=shifts, moments=moments, offset=0.5 * dot(moments[: len(goals)], shifts))


def rest_angles(
    bending: BendingModel, chosen: Ints, schedules: tuple[Schedule, ...], counts: tuple[int, ...]
) -> RestAngleEnergy:
    """Creases along the hinges `chosen` (k,) of a bending energy, `counts` of them for each schedule."""
    columns = _columns(bending, chosen)
    around = np.concatenate([chosen, np.setdiff1d(columns.indices, chosen)])
    rest, none = bending.rest_angles[around], np.zeros(len(around))
    moments = bending.vertices[around], rest, none, 0.0
    return RestAngleEnergy(*moments, chosen, none[: len(chosen)], columns.T.tocsr()[around], schedules, counts)


def _columns(bending: BendingModel, chosen: Ints) -> sparse.csr_array:
    """The columns of K = B' w B of the chosen hinges, as rows: (k, h) [N m]."""
    strains, weights = bending.strains_of_angles()
    own = sparse.diags_array(np.repeat(weights, strains.shape[0] // len(weights))) @ strains
    return (strains.T.tocsr()[chosen] @ own).tocsr()


def radians(angle: Schedule, time: float) -> float:
    """The rest angle at `time` [s] in radians. InputError for half a turn and more."""
    degrees = angle.at(time)
    if not abs(degrees) < 180:
        raise InputError(f"{angle.name} is {degrees:g} at {time:g} s.", "Give less than 180 degrees.")
    return float(np.radians(degrees))
