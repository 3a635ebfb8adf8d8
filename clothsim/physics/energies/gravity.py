"""Weight in a uniform field: the effect `gravity`."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.vectors import as_rows, taken
from clothsim.keys.typed_effects import Gravity
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Energy, Off, Step
from clothsim.physics.energies.example import Example
from clothsim.physics.energies.hessians import ElementHessian, diagonal_hessian, every_vertex
from clothsim.physics.energies.protocols import Elementwise, NoPastSensitivity

NO_BLOCKS = diagonal_hessian(every_vertex(0), np.zeros(0))


@dataclass(frozen=True)
class GravityEnergy(Elementwise, Energy, NoPastSensitivity):
    """E = -sum m g.(x - origin).

    Parameters
    ----------
    rows : (n, 1) int array
        Rows of x.
    masses : (n,) array
        [kg].
    acceleration : (3,) array
        g [m/s2].
    origin : (3,) array
        Reference of the potential [m], near the cloth, so that differences of E do not cancel.
    load : float
        Fraction of the load that acts.
    """

    rows: Ints
    masses: Floats
    acceleration: Floats
    origin: Floats
    load: float = 1.0

    per_element = ("rows", "masses")

    def begin(self, step: Step) -> Self:
        """A copy with the load of the step."""
        return replace(self, load=step.load)

    def value(self, x: Floats) -> float:
        """Potential energy relative to the origin [J]."""
        moment = self.masses @ (taken(x, as_rows(self.rows[:, 0])) - self.origin)
        return float(-self.load * (moment @ self.acceleration))

    def gradient(self, x: Floats) -> Floats:
        """-m g, (N, 3) [N]."""
        out = np.zeros_like(x)
        out[as_rows(self.rows[:, 0])] = self._gradient
        return out

    @cached_property
    def _gradient(self) -> Floats:
        return -self.load * self.masses[:, None] * self.acceleration

    def hessian(self, x: Floats, project: bool = True) -> ElementHessian:
        """No blocks: the energy is linear."""
        return NO_BLOCKS


def gravity(world: World, keys: Gravity) -> Energy | Off:
    """The weight of all cloths and rigid bodies; off where the acceleration is zero."""
    vector = np.array(keys.acceleration, np.float64)
    if not vector.any():
        return Off("acceleration is zero")
    origin = world.moved().mean(axis=0)
    return GravityEnergy(every_vertex(world.n_unknowns), world.weighing_masses, vector, origin)


EXAMPLE = Example(
    keys={"acceleration": (0.3, -0.4, -1.2)}, in_scene={}, zero={"acceleration": [0, 0, 0]}, external=True, linear=True
)
