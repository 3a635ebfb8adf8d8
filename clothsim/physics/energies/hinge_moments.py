"""Moments about hinges, constant in a step: what creases and plastic folds add to the bending energy.

The bending energy is quadratic in the angles, sum w |B (theta - theta0)|^2/2 with the strains B theta of a model: the
angles themselves and w = k in the hinge model, curvatures of triangles and w = A D in the mid-edge model. With the
strains p at rest instead of 0 it differs by the energy of this file,

    E = sum w |p|^2/2 - M'(theta - theta0),   M = B' (w p)        [J],

so that an effect that changes the rest shape leaves the bending energy unchanged: it adds the moments -M. The
Gauss-Newton Hessian of bending does not depend on p: the projected Hessian here is zero, the exact one
-M d2theta/dx2.
"""

from dataclasses import dataclass
from typing import ClassVar, TypeAlias

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.base.linalg import dot
from clothsim.physics.energies import hinge_kernels as kernels
from clothsim.physics.energies.base import Energy
from clothsim.physics.energies.hessians import LanesHessian, SumHessian
from clothsim.physics.energies.hinge_bending import HingeBending
from clothsim.physics.energies.midedge_bending import MidedgeBending
from clothsim.physics.energies.midedge_softening import SofteningBending
from clothsim.physics.energies.protocols import ChangingMaterial, Elementwise, Idling

BendingModel: TypeAlias = HingeBending | MidedgeBending
"""Bending models with rest angles that can change."""


@dataclass(frozen=True)
class HingeMoments(Elementwise, Energy):
    """E = offset - M'(theta - theta0); +inf where a triangle beside a hinge has no area.

    Such a hinge adds nothing to gradient and Hessian.

    Parameters
    ----------
    vertices : (h, 4) int array
        Rows of x.
    references : (h,) array
        theta0 [rad].
    moments : (h,) array
        M [N m], of this step.
    offset : float
        [J], of this step.
    """

    vertices: Ints
    references: Floats
    moments: Floats
    offset: float

    per_element: ClassVar[tuple[str, ...]] = ("vertices", "references", "moments")

    def value(self, x: Floats) -> float:
        """E(x) [J]."""
        active = self._active()
        turned = kernels.angles(self.vertices[active], x) - self.references[active]
        return self.offset - dot(self.moments[active], turned) if np.isfinite(turned).all() else np.inf

    def gradient(self, x: Floats) -> Floats:
        """dE/dx, (N, 3) [N]."""
        active = self._active()
        return kernels.gradient(self.vertices[active], -self.moments[active], x)

    def hessian(self, x: Floats, project: bool = True) -> LanesHessian | SumHessian:
        """Exact: 12 x 12 for each hinge with a moment [N/m]; projected: none."""
        active = self._active() if not project else np.zeros(0, np.int64)
        return kernels.hinge_hessian(self.vertices[active], -self.moments[active], np.zeros(len(active)), x)

    def _active(self) -> Ints:
        return np.flatnonzero(self.moments)


@dataclass(frozen=True)
class ShiftedAngles(HingeMoments, Idling):
    """Hinges whose rest angles are shifted.

    Parameters
    ----------
    numbers : (k,) int array
        Numbers of the shifted hinges in the bending energy; they are the first of `vertices`.
    shifts : (k,) array
        s [rad], of this step.
    """

    numbers: Ints
    shifts: Floats

    @property
    def idle(self) -> bool:
        """True where there is no moment."""
        return not self.moments.any()


def hinges_of_bending(name: str, bending: Energy) -> BendingModel:
    """The bending energy, whose rest angles the effect `name` changes.

    Raises
    ------
    InputError
        For a bending model without rest angles that can change, or whose energy is not quadratic in the angles.
    """
    if isinstance(bending, ChangingMaterial):
        raise InputError(
            f"effects.{name} changes rest angles, which cloth whose material changes over time does not take.",
            "Give the keys of the cloth as numbers.",
        )
    if not isinstance(bending, HingeBending | MidedgeBending):
        raise InputError(
            f"effects.{name} changes rest angles, and {type(bending).__name__} has none that can change.",
            'Set effects.bending.model = "midedge" or "hinge".',
        )
    if isinstance(bending, SofteningBending):
        raise InputError(
            f"effects.{name} changes rest angles, which bending with a slope or hysteresis does not take.",
            "Set cloth.bending_slope and cloth.bending_hysteresis to 0.",
        )
    return bending
