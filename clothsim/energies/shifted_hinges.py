"""What creases have in common: hinges whose angle at rest is shifted, as a moment beside the bending energy.

Bending is k/2 (theta - theta0)^2 a hinge. With the rest angle at theta0 + s it is k/2 (theta - theta0 - s)^2, and the
difference is the moment energy of this file,

    E = sum k s^2 / 2 - k s (theta - theta0)        [J].

So an effect that shifts rest angles leaves bending as it is. The Gauss-Newton Hessian of bending, k g g', does not know
s: projected, there is nothing to add to it; exact, it is -k s d2theta/dx2.
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
    """vertices (h, 4); references theta0 (h,) [rad]; stiffnesses k (h,) [N m], those of bending; shifts s (h,) [rad];
    numbers (h,): which of bending's hinges they are.

    The value is +inf where a triangle beside a hinge has no area; such a hinge adds nothing to gradient and Hessian.
    """

    vertices: Ints
    references: Floats
    stiffnesses: Floats
    shifts: Floats
    numbers: Ints

    per_element: ClassVar[tuple[str, ...]] = ("vertices", "references", "stiffnesses", "shifts", "numbers")

    @property
    def idle(self) -> bool:
        """True where no angle is shifted."""
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
        return kernels.pull(self.vertices[active], -self._moments(active), x)

    def hessian(self, x: Floats, project: bool = True) -> LanesHessian:
        """Exact: 12 x 12 for each hinge that is shifted [N/m]; projected: none."""
        active = self._active() if not project else np.zeros(0, np.int64)
        hinges = self.vertices[active], -self._moments(active), np.zeros(len(active))
        return LanesHessian(hinges[0], lambda lanes, first: kernels.fill(lanes, first, *hinges, x))

    def _active(self) -> Ints:
        return np.flatnonzero(self.shifts)

    def _moments(self, active: Ints) -> Floats:
        return self.stiffnesses[active] * self.shifts[active]


def hinges_of_bending(name: str, bending: Energy | None) -> HingeBending | None:
    """The hinges that the effect `name` shifts, None without bending. InputError where bending has no angles."""
    if bending is not None and not isinstance(bending, HingeBending):
        raise InputError(
            f"effects.{name} sets the rest angles of hinges, and {type(bending).__name__} has none that can change.",
            'Take effects.bending.model = "hinge".',
        )
    return bending
