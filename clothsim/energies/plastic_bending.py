"""The effect `plastic_bending`: folds beyond a yield angle stay.

Each hinge has a plastic angle p, by which its rest angle is shifted (`shifted_hinges`). With the elastic angle
e = theta - theta0 - p, the yield angle y and linear kinematic hardening H (Prager 1956; the return mapping of Simo and
Hughes 1998, "Computational inelasticity", box 1.4), p flows where |e - H p| > y, without regard to how fast:

    p += sign(e - H p) (|e - H p| - y) / (1 + H).

So a fold held at theta_m keeps (theta_m - y) / (1 + H) once it is let go. y is given as an angle, or as a curvature
kappa, y = kappa (A1 + A2)/|e|, which is a property of the fabric and not of the mesh.

p flows at the start of a step, from the angles there, and stays during it: within a step the moment may pass the yield
by what the fold moves in dt, an error of first order. A fold at the start of a run flows at once.
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
    """rest_angles (h,) [rad] without creases; yields y (h,) [rad]; hardening H, as share of the hinge's stiffness."""

    rest_angles: Floats
    yields: Floats
    hardening: float

    per_element = (*ShiftedHinges.per_element, "rest_angles", "yields")
    begins_last = True

    @property
    def carry_over(self) -> Floats:
        """p of every hinge, (h,) [rad]."""
        return self.shifts

    def begin(self, step: Step) -> Self:
        """Bound to the p that the angles at the start of the step leave, over the rest angles with their creases."""
        references = self.rest_angles.copy()
        for other in step.bound.values():
            if isinstance(other, ShiftedHinges):
                references[other.numbers] += other.shifts
        before = np.asarray(step.memory.get(NAME, np.zeros(len(references))), np.float64)
        bend = angles(self.vertices, step.positions) - references
        return replace(self, references=references, shifts=flowed(bend, before, self.yields, self.hardening))


def flowed(bend: Floats, plastic: Floats, yields: Floats, hardening: float) -> Floats:
    """The plastic angles (h,) after the return mapping, from those before and theta - theta0 (h,) [rad]."""
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
    """Folds that stay where a hinge bends by more than yield_angle_degrees, or the cloth by more than yield_curvature
    [1/m]: one of the two; 0 is never. hardening: how much the yield moves along, as share of the bending stiffness.
    """
    degrees = as_positive("effects.plastic_bending.yield_angle_degrees", yield_angle_degrees, zero=True)
    curvature = as_positive("effects.plastic_bending.yield_curvature", yield_curvature, zero=True)
    ratio = as_positive("effects.plastic_bending.hardening", hardening, zero=True)
    if degrees and curvature:
        raise InputError("effects.plastic_bending has yield_angle_degrees and yield_curvature.", "Give one of them.")
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
