"""Plastic bending with kinematic hardening: the effect `plastic_bending`.

The yield y is given as a curvature kappa, which is a property of the fabric and not of the mesh, or as the angle of a
hinge. Hinges of edge length |e| between areas A1 and A2 take y = kappa (A1 + A2)/|e|, triangles of the mid-edge model
the angle over the mean (A1 + A2)/|e| of the hinges in their curvature.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from scipy import sparse

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.keys.typed_effects import PlasticBending
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Energy, Off, Step
from clothsim.physics.energies.example import Example, Idle
from clothsim.physics.energies.hinge_bending import HingeBending
from clothsim.physics.energies.hinge_kernels import angles
from clothsim.physics.energies.hinge_moments import HingeMoments, ShiftedAngles, hinges_of_bending
from clothsim.physics.energies.protocols import History


def plastic_bending(world: World, keys: PlasticBending, *, built: Mapping[str, Energy] | None = None) -> Energy | Off:
    """Permanent folds beyond a yield angle or curvature; off without yield or bending.

    built: the energies built so far, with the bending whose angles are shifted.

    Raises
    ------
    InputError
        For both kinds of yield, or a bending model without rest angles.
    """
    degrees, curvature = keys.yield_angle_degrees, keys.yield_curvature
    if degrees and curvature:
        sentence = "effects.plastic_bending has both yield_angle_degrees and yield_curvature."
        raise InputError(sentence, "Give one of them.")
    if not degrees and not curvature:
        return Off("no yield is given")
    bending = (built or {}).get("bending")
    if bending is None:
        return Off("the scene has no bending")
    hinges = hinges_of_bending(NAME, bending)
    strains, weights = hinges.strains_of_angles()
    stiff = world.hinges.stiffness > 0
    widths = world.hinges.areas[stiff] / world.hinges.edge_lengths[stiff]
    if isinstance(hinges, HingeBending):
        yields = curvature * widths if curvature else np.full(len(widths), np.radians(degrees))
    else:
        yields = np.full(len(weights), curvature) if curvature else np.radians(degrees) / hinges.widths(widths)
    rest, none = hinges.rest_angles, np.zeros(len(widths))
    flow = strains, weights, yields, keys.hardening, np.zeros((len(weights), strains.shape[0] // len(weights)))
    return PlasticBendingEnergy(hinges.vertices, rest, none, 0.0, rest, *flow)


EXAMPLE = Example(
    keys={"yield_angle_degrees": 1.0, "hardening": 0.3},
    in_scene={"yield_angle_degrees": 1.0},
    zero={"hardening": 0.5},
    idle=Idle(always={"yield_angle_degrees": 179.0}, sometimes={"yield_angle_degrees": 0.02}),
)


# The strains of bending e = B (theta - theta0) have plastic parts p (`hinge_moments`): in the hinge model the angle of
# each hinge, in the mid-edge model the three components of the curvature of each triangle, scaled such that their
# squares sum to (1 - nu) |S|^2 + nu tr(S)^2: their norm is the curvature of a cylindrical bend in any direction. With
# the yield y and linear kinematic hardening H (Prager 1956; return mapping: Simo and Hughes 1998, "Computational
# inelasticity", box 1.4), p flows along q = e - (1 + H) p where |q| > y, independent of the rate:
#
#     p += q/|q| (|q| - y) / (1 + H),
#
# the associated flow of the elastic energy w |e - p|^2/2, so that it only dissipates. A fold held at theta_m retains
# (theta_m - y) / (1 + H) when it is released.
#
# p is updated at the start of a step, from the angles there, and constant within it: an error of first order in dt. A
# fold at the start of a run flows at once.


NAME = "plastic_bending"


@dataclass(frozen=True)
class PlasticBendingEnergy(HingeMoments, History):
    """Plastic strains of bending.

    Parameters
    ----------
    rest_angles : (h,) array
        Rest angles without creases [rad].
    strains : (g r, h) sparse array
        B: r strains of each of g elements, hinges or triangles [1 or 1/m].
    weights : (g,) array
        w of each element [N m or J m2].
    yields : (g,) array
        y [rad or 1/m].
    hardening : float
        H, relative to the stiffness of bending.
    plastic : (g, r) array
        p, of this step.
    """

    rest_angles: Floats
    strains: sparse.csr_array
    weights: Floats
    yields: Floats
    hardening: float
    plastic: Floats

    begins_last = True

    @property
    def carry_over(self) -> Floats:
        """p, (g r,): of each hinge [rad], or of each triangle [1/m]."""
        return self.plastic.ravel()

    def begin(self, step: Step) -> Self:
        """A copy with p after the return mapping at the start of the step, relative to rest angles with creases."""
        references = self.rest_angles.copy()
        for other in step.bound.values():
            if isinstance(other, ShiftedAngles):
                references[other.numbers] += other.shifts
        memory = step.memory.get(NAME, np.zeros(self.plastic.size))
        before = np.asarray(memory, np.float64).reshape(self.plastic.shape)
        turned = angles(self.vertices, step.positions) - references
        plastic = flowed(self._strain(turned), before, self.yields, self.hardening)
        stresses = self.weights[:, None] * plastic
        offset = 0.5 * float(np.sum(stresses * plastic))
        moments = self.strains.T @ stresses.ravel()
        return replace(self, references=references, plastic=plastic, moments=moments, offset=offset)

    def _strain(self, turned: Floats) -> Floats:
        """e (g, r) of changes of angle (h,); +inf in an element at a hinge without an angle."""
        defined = np.isfinite(turned)
        strain = (self.strains @ np.where(defined, turned, 0.0)).reshape(self.plastic.shape)
        if not defined.all():
            strain[(abs(self.strains) @ (~defined).astype(np.float64)).reshape(strain.shape).any(axis=1)] = np.inf
        return strain


def flowed(strain: Floats, plastic: Floats, yields: Floats, hardening: float) -> Floats:
    """Return mapping: plastic strains (g, r) from the previous ones, e (g, r) and the yields (g,)."""
    defined = np.asarray(np.isfinite(strain).all(axis=1))
    driving = np.where(defined[:, None], strain, 0.0) - (1 + hardening) * plastic
    sizes = np.asarray(np.linalg.norm(driving, axis=1), np.float64)
    beyond = np.where(defined, np.maximum(sizes - yields, 0.0), 0.0)
    directions = np.divide(driving, sizes[:, None], out=np.zeros_like(driving), where=sizes[:, None] > 0)
    return np.asarray(plastic + directions * (beyond / (1 + hardening))[:, None], np.float64)
