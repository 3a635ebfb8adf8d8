"""The effect `damping`: a drag proportional to mass and velocity, which lets a drape settle."""

from dataclasses import dataclass, replace
from typing import Self

from clothsim.arrays import Floats, as_positive
from clothsim.energies.base import ElementHessian, Energy, Off, Step
from clothsim.energies.inertia import diagonal_hessian, weighted_difference, weighted_square
from clothsim.mesh.world import World


@dataclass(frozen=True)
class MassDamping(Energy):
    """E = rate sum m |x - x_n|^2 / (2 h): the force is -rate m v (Rayleigh's mass term).

    masses (n,) [kg]; rate [1/s]; start x_n (n, 3) [m] and dt h [s] of the step; in BDF2 x^ and b h (FORMULAS 2).
    """

    masses: Floats
    rate: float
    start: Floats
    dt: float

    incremental = True

    def begin(self, step: Step) -> Self:
        """Bound to x_n and h of the step."""
        past = step.past
        return replace(self, start=past.positions[: len(self.masses)], dt=past.dt)

    def value(self, x: Floats) -> float:
        """Incremental dissipation [J]."""
        return self.rate * weighted_square(self.masses, x, self.start) / (2 * self.dt)

    def gradient(self, x: Floats) -> Floats:
        """rate m (x - x_n) / h, (N, 3) [N]."""
        return weighted_difference(self.rate * self.masses / self.dt, x, self.start)

    def hessian(self, x: Floats, project: bool = True) -> ElementHessian:
        """rate m / h on the diagonal [N/m]."""
        return diagonal_hessian(self.rate * self.masses / self.dt)


def damping(world: World, *, rate: float = 1.0) -> Energy | Off:
    """Mass-proportional damping with a decay rate [1/s]; off where the rate is 0."""
    if as_positive("effects.damping.rate", rate, zero=True) == 0:
        return Off("rate is 0")
    return MassDamping(world.masses, float(rate), world.start()[: world.n_cloth], 1.0)
