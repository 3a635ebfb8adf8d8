"""Incremental inertia: the effect `inertia`, which makes the minimiser of E a time step."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Energy, Step
from clothsim.physics.energies.example import Example
from clothsim.physics.energies.hessians import (
    ElementHessian,
    diagonal_hessian,
    every_vertex,
    weighted_difference,
    weighted_square,
)
from clothsim.physics.energies.protocols import Elementwise, PastSensitivity, StartDerivatives


@dataclass(frozen=True)
class InertiaEnergy(Elementwise, Energy, PastSensitivity):
    """E = sum m |x - x~|^2 / (2 h^2), x~ = x_n + h v_n.

    With BDF2 x^, v^ and b h replace them (docs/theory.md#time-integration).

    Gravity is an energy of its own and no part of x~.

    Parameters
    ----------
    rows : (n, 1) int array
        Rows of x.
    masses : (n,) array
        [kg].
    target : (n, 3) array
        x~ [m].
    dt : float
        h or b h [s].
    """

    rows: Ints
    masses: Floats
    target: Floats
    dt: float

    per_element = ("rows", "masses", "target")
    incremental = True

    def begin(self, step: Step) -> Self:
        """A copy with x~ and h of the step."""
        rows, past = self.rows[:, 0], step.past
        return replace(self, target=past.positions[rows] + past.dt * past.velocities[rows], dt=past.dt)

    def value(self, x: Floats) -> float:
        """Incremental kinetic energy [J]."""
        return weighted_square(self.rows, self.masses, x, self.target) / (2 * self.dt**2)

    def gradient(self, x: Floats) -> Floats:
        """m (x - x~) / h^2, (N, 3) [N]."""
        return weighted_difference(self.rows, self.masses / self.dt**2, x, self.target)

    def hessian(self, x: Floats, project: bool = True) -> ElementHessian:
        """m / h^2 on the diagonal [N/m]."""
        return self._hessian

    def past_sensitivity(self, step: Step, x: Floats, adjoint: Floats) -> StartDerivatives:
        """-m a / h^2 by x_n, and h times that by v_n."""
        by_positions = weighted_difference(self.rows, -self.masses / self.dt**2, adjoint, np.zeros_like(self.target))
        return StartDerivatives(past_positions=by_positions, past_velocities=self.dt * by_positions)

    @cached_property
    def _hessian(self) -> ElementHessian:
        return diagonal_hessian(self.rows, self.masses / self.dt**2)


def inertia(world: World) -> Energy:
    """The inertia of all cloth vertices and rigid bodies."""
    return InertiaEnergy(every_vertex(world.n_unknowns), world.inertial_masses, world.start()[: world.n_unknowns], 1.0)


EXAMPLE = Example(external=True)
