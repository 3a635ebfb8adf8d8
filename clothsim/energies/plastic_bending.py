"""Plastic bending with kinematic hardening: the effect `plastic_bending`.

The rest angle of each hinge is shifted by a plastic angle p (`shifted_hinges`). With the elastic angle
e = theta - theta0 - p, the yield angle y and linear kinematic hardening H (Prager 1956; return mapping: Simo and Hughes
1998, "Computational inelasticity", box 1.4), p flows where |e - H p| > y, independent of the rate:

    p += sign(e - H p) (|e - H p| - y) / (1 + H).

A fold held at theta_m retains (theta_m - y) / (1 + H) when it is released. y is given as an angle, or as a curvature
kappa, y = kappa (A1 + A2)/|e|, which is a property of the fabric and not of the mesh.

p is updated at the start of a step, from the angles there, and constant within it: an error of first order in dt. A
fold at the start of a run flows at once.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from clothsim.arrays import Floats, as_positive
from clothsim.energies.base import Energy, Off
from clothsim.energies.example import Example, Idle
from clothsim.energies.hinge_kernels import angles
from clothsim.energies.protocols import History
from clothsim.energies.shifted_hinges import ShiftedHinges, hinges_of_bending
from clothsim.energies.step import Step
from clothsim.errors import InputError
from clothsim.mesh.world import World

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


def plastic_bending(
    world: World,
    *,
    yield_angle_degrees: float = 0.0,
    yield_curvature: float = 0.0,
    hardening: float = 0.0,
    built: Mapping[str, Energy] | None = None,
) -> Energy | Off:
    """Permanent folds beyond a yield angle or curvature.

    Parameters
    ----------
    yield_angle_degrees : float
        Yield angle of a hinge; 0: none.
    yield_curvature : float
        Yield curvature of the cloth [1/m]; 0: none. At most one of both is given.
    hardening : float
        Kinematic hardening relative to the bending stiffness.
    built : mapping, optional
        The energies built so far, with the bending whose angles are shifted.

    Returns
    -------
    PlasticBending, or Off without yield or bending.

    Raises
    ------
    InputError
        For both kinds of yield, or a bending model without rest angles.
    """
    degrees = as_positive("effects.plastic_bending.yield_angle_degrees", yield_angle_degrees, zero=True)
    curvature = as_positive("effects.plastic_bending.yield_curvature", yield_curvature, zero=True)
    ratio = as_positive("effects.plastic_bending.hardening", hardening, zero=True)
    if degrees and curvature:
        sentence = "effects.plastic_bending has both yield_angle_degrees and yield_curvature."
        raise InputError(sentence, "Give one of them.")
    if not degrees and not curvature:
        return Off("no yield is given")
    hinges = hinges_of_bending(NAME, (built or {}).get("bending"))
    if hinges is None:
        return Off("the scene has no bending")
    stiff = world.hinges.stiffness > 0
    widths = world.hinges.areas[stiff] / world.hinges.edge_lengths[stiff]
    yields = curvature * widths if curvature else np.full(len(widths), np.radians(degrees))
    every, none = np.arange(len(widths)), np.zeros(len(widths))
    rest = hinges.rest_angles
    return PlasticBending(hinges.vertices, rest, hinges.stiffnesses, none, every, rest, yields, ratio)


EXAMPLE = Example(
    keys={"yield_angle_degrees": 1.0, "hardening": 0.3},
    in_scene={"yield_angle_degrees": 1.0},
    zero={"hardening": 0.5},
    idle=Idle(always={"yield_angle_degrees": 179.0}, sometimes={"yield_angle_degrees": 0.02}),
)
