"""The effect `inertia`: the term that turns a sum of potentials into a time step."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from clothsim.arrays import Floats
from clothsim.energies.base import ElementHessian, Energy, Step
from clothsim.energies.diagonal import diagonal_hessian
from clothsim.linalg import dot
from clothsim.mesh.world import World


@dataclass(frozen=True)
class Inertia(Energy):
    """E = sum m |x - x~|^2 / (2 h^2), x~ = x_n + h v_n; in BDF2 with x^, v^ and b h in their places (FORMULAS 2).

    Gravity is an Energy of its own and no part of x~. masses (n,) [kg]; target x~ (n, 3) [m]; dt: h or b h [s].
    """

    masses: Floats
    target: Floats
    dt: float

    incremental = True

    def begin(self, step: Step) -> Self:
        """Bound to x~ and h of the step."""
        n, past = len(self.masses), step.past
        return replace(self, target=past.positions[:n] + past.dt * past.velocities[:n], dt=past.dt)

    def value(self, x: Floats) -> float:
        """Incremental kinetic energy [J]."""
        return weighted_square(self.masses, x, self.target) / (2 * self.dt**2)

    def gradient(self, x: Floats) -> Floats:
        """m (x - x~) / h^2, (N, 3) [N]."""
        return weighted_difference(self.masses / self.dt**2, x, self.target)

    def hessian(self, x: Floats, project: bool = True) -> ElementHessian:
        """m / h^2 on the diagonal [N/m]."""
        return diagonal_hessian(self.masses / self.dt**2)


def inertia(world: World) -> Energy:
    """The inertia of all cloth vertices; bound to its step by `begin`."""
    return Inertia(world.masses, world.start()[: world.n_cloth], 1.0)


def weighted_square(weights: Floats, x: Floats, target: Floats) -> float:
    """sum w |x - target|^2 over the first n rows of x."""
    return dot(weights, ((x[: len(weights)] - target) ** 2).sum(axis=1))


def weighted_difference(weights: Floats, x: Floats, target: Floats) -> Floats:
    """w (x - target) in the first n rows, 0 in the others, (N, 3)."""
    out = np.zeros_like(x)
    out[: len(weights)] = weights[:, None] * (x[: len(weights)] - target)
    return out
