"""Shifted rest angles of hinges, as moments added to the bending energy.

The bending energy of a hinge is k/2 (theta - theta0)^2. With the rest angle theta0 + s it is
k/2 (theta - theta0 - s)^2; the difference is the energy of this file,

    E = sum k s^2 / 2 - k s (theta - theta0)        [J].

so that an effect that shifts rest angles leaves the bending energy unchanged. The Gauss-Newton Hessian of bending,
k g g', does not depend on s: the projected Hessian here is zero, the exact one is -k s d2theta/dx2.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.energies import hinge_kernels as kernels
from clothsim.energies.base import Energy
from clothsim.energies.elementwise import Elementwise
from clothsim.energies.hessians import LanesHessian
from clothsim.energies.hinge_bending import HingeBending
from clothsim.energies.protocols import Idling
from clothsim.errors import InputError
from clothsim.linalg import dot


@dataclass(frozen=True)
class ShiftedHinges(Elementwise, Energy, Idling):
    """E = sum k s^2/2 - k s (theta - theta0); +inf where a triangle beside a hinge has no area.

    Such a hinge adds nothing to gradient and Hessian.

    Parameters
    ----------
    vertices : (h, 4) int array
        Rows of x.
    references : (h,) array
        theta0 [rad].
    stiffnesses : (h,) array
        k of bending [N m].
    shifts : (h,) array
        s [rad].
    numbers : (h,) int array
        Numbers of the hinges in the bending energy.
    """

    vertices: Ints
    references: Floats
    stiffnesses: Floats
    shifts: Floats
    numbers: Ints

    per_element: ClassVar[tuple[str, ...]] = ("vertices", "references", "stiffnesses", "shifts", "numbers")

    @property
    def idle(self) -> bool:
        """True where no rest angle is shifted."""
        return not self.shifts.any()

    def value(self, x: Floats) -> float:
        """E(x) [J]."""
        active = self._active()
        offset = 0.5 * float(np.sum(self.stiffnesses * self.shifts**2))
        turned = kernels.angles(self.vertices[active], x) - self.references[active]
        return offset - dot(self._moments(active), turned) if np.isfinite(turned).all() else np.inf

    def gradient(self, x: Floats) -> Floats:
        """dE/dx, (N, 3) [N]."""
        active = self._active()
        return kernels.gradient(self.vertices[active], -self._moments(active), x)

    def hessian(self, x: Floats, project: bool = True) -> LanesHessian:
        """Exact: 12 x 12 for each shifted hinge [N/m]; projected: none."""
        active = self._active() if not project else np.zeros(0, np.int64)
        hinges = self.vertices[active], -self._moments(active), np.zeros(len(active))
        return LanesHessian(hinges[0], lambda lanes, first: kernels.fill(lanes, first, *hinges, x))

    def _active(self) -> Ints:
        return np.flatnonzero(self.shifts)

    def _moments(self, active: Ints) -> Floats:
        return self.stiffnesses[active] * self.shifts[active]


def hinges_of_bending(name: str, bending: Energy) -> HingeBending:
    """The hinges of the bending energy whose rest angles the effect `name` shifts.

    Raises
    ------
    InputError
        For a bending model without rest angles that can be shifted.
    """
    if not isinstance(bending, HingeBending):
        raise InputError(
            f"effects.{name} sets the rest angles of hinges, and {type(bending).__name__} has none that can change.",
            'Set effects.bending.model = "hinge".',
        )
    return bending
