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
from clothsim.compiled import kernel
from clothsim.energies.base import ElementHessian, Energy
from clothsim.energies.hinge_bending import HingeBending
from clothsim.errors import InputError
from clothsim.kinematics.hinge import hinge_angle, hinge_angle_gradient, hinge_hessian, hinge_points


@dataclass(frozen=True)
class ShiftedHinges(Energy):
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
        return offset - _work(self.vertices[active], self.references[active], self._moments(active), x)

    def gradient(self, x: Floats) -> Floats:
        """dE/dx, (N, 3) [N]."""
        active = self._active()
        return _gradient(self.vertices[active], -self._moments(active), x)

    def hessian(self, x: Floats, project: bool = True) -> ElementHessian:
        """Exact: 12 x 12 for each hinge that is shifted [N/m]; projected: none."""
        active = self._active() if not project else np.zeros(0, np.int64)
        vertices = self.vertices[active]
        return ElementHessian(vertices, _hessian(vertices, -self._moments(active), x))

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


@kernel
def angles(vertices: Ints, x: Floats) -> Floats:
    """The angle of each hinge, (h,) [rad]; +inf where a triangle has no area."""
    found = np.empty(len(vertices))
    for h in range(len(vertices)):
        a, b, c, d = hinge_points(x, vertices, h)
        found[h] = hinge_angle(a, b, c, d)
    return found


@kernel
def _work(vertices: Ints, references: Floats, moments: Floats, x: Floats) -> float:
    """sum M (theta - theta0), -inf where a hinge has no angle."""
    work = 0.0
    for h in range(len(vertices)):
        a, b, c, d = hinge_points(x, vertices, h)
        angle = hinge_angle(a, b, c, d)
        if np.isinf(angle):
            return -np.inf
        work += moments[h] * (angle - references[h])
    return work


@kernel
def _gradient(vertices: Ints, moments: Floats, x: Floats) -> Floats:
    """M dtheta/dx."""
    gradient = np.zeros_like(x)
    for h in range(len(vertices)):
        a, b, c, d = hinge_points(x, vertices, h)
        g = hinge_angle_gradient(a, b, c, d)
        for k in range(4):
            for i in range(3):
                gradient[vertices[h, k], i] += moments[h] * g[k][i]
    return gradient


@kernel
def _hessian(vertices: Ints, moments: Floats, x: Floats) -> Floats:
    """M d2theta/dx2."""
    blocks = np.zeros((len(vertices), 12, 12))
    for h in range(len(vertices)):
        a, b, c, d = hinge_points(x, vertices, h)
        hinge_hessian(a, b, c, d, moments[h], 0.0, blocks[h])
    return blocks
