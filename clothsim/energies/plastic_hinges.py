"""Plastic bending with kinematic hardening.

The rest angle of each hinge is shifted by a plastic angle p (`shifted_hinges`). With the elastic angle
e = theta - theta0 - p, the yield angle y and linear kinematic hardening H (Prager 1956; return mapping: Simo and Hughes
1998, "Computational inelasticity", box 1.4), p flows where |e - H p| > y, independent of the rate:

    p += sign(e - H p) (|e - H p| - y) / (1 + H).

A fold held at theta_m retains (theta_m - y) / (1 + H) when it is released.

p is updated at the start of a step, from the angles there, and constant within it: an error of first order in dt. A
fold at the start of a run flows at once.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from clothsim.arrays import Floats
from clothsim.energies.hinge_kernels import angles
from clothsim.energies.protocols import History
from clothsim.energies.shifted_hinges import ShiftedHinges
from clothsim.energies.step import Step

NAME = "plastic_bending"


@dataclass(frozen=True)
class PlasticBending(ShiftedHinges, History):
    """Plastic shifts of rest angles.

    Parameters
    ----------
    rest_angles : (h,) array
        Rest angles without creases [rad].
    yields : (h,) array
        y [rad].
    hardening : float
        H, relative to the stiffness of the hinge.
    """

    rest_angles: Floats
    yields: Floats
    hardening: float

    per_element = (*ShiftedHinges.per_element, "rest_angles", "yields")
    begins_last = True

    @property
    def carry_over(self) -> Floats:
        """p of each hinge, (h,) [rad]."""
        return self.shifts

    def begin(self, step: Step) -> Self:
        """A copy with p after the return mapping at the start of the step, relative to rest angles with creases."""
        references = self.rest_angles.copy()
        for other in step.bound.values():
            if isinstance(other, ShiftedHinges):
                references[other.numbers] += other.shifts
        before = np.asarray(step.memory.get(NAME, np.zeros(len(references))), np.float64)
        bend = angles(self.vertices, step.positions) - references
        return replace(self, references=references, shifts=flowed(bend, before, self.yields, self.hardening))


def flowed(bend: Floats, plastic: Floats, yields: Floats, hardening: float) -> Floats:
    """Return mapping: the plastic angles (h,) from the previous ones and theta - theta0 (h,) [rad]."""
    driving = np.where(np.isfinite(bend), bend, 0.0) - (1 + hardening) * plastic
    beyond = np.where(np.isfinite(bend), np.maximum(np.abs(driving) - yields, 0.0), 0.0)
    return np.asarray(plastic + np.sign(driving) * beyond / (1 + hardening), np.float64)
