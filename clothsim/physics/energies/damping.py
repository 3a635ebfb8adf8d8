"""Damping of velocity, of the strain rate and of the bending rate: the effect `damping`."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.keys.typed_effects import Damping
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Energy, Off
from clothsim.physics.energies.diagonal import diagonal_hessian, every_vertex, weighted_difference, weighted_square
from clothsim.physics.energies.elementwise import Elementwise
from clothsim.physics.energies.example import Example
from clothsim.physics.energies.hessians import ByElement, ElementHessian
from clothsim.physics.energies.protocols import PastSensitivity, Restrictable, SeesPast, restricted
from clothsim.physics.energies.step import Step
from clothsim.physics.energies.varying_values import over_cloth


@dataclass(frozen=True)
class MassDamping(Elementwise, Energy, SeesPast):
    """E = rate sum m |x - x_n|^2 / (2 h): the force is -rate m v (Rayleigh's mass term).

    With BDF2 x^ and b h replace x_n and h (docs/theory.md#time-integration).

    Parameters
    ----------
    rows : (n, 1) int array
        Rows of x.
    masses : (n,) array
        [kg].
    rate : float
        [1/s].
    start : (n, 3) array
        x_n of the step [m].
    dt : float
        h [s].
    """

    rows: Ints
    masses: Floats
    rate: float
    start: Floats
    dt: float

    per_element = ("rows", "masses", "start")
    incremental = True

    def begin(self, step: Step) -> Self:
        """A copy with x_n and h of the step."""
        past = step.past
        return replace(self, start=past.positions[self.rows[:, 0]], dt=past.dt)

    def value(self, x: Floats) -> float:
        """Incremental dissipation [J]."""
        return self.rate * weighted_square(self.rows, self.masses, x, self.start) / (2 * self.dt)

    def gradient(self, x: Floats) -> Floats:
        """rate m (x - x_n) / h, (N, 3) [N]."""
        return weighted_difference(self.rows, self.rate * self.masses / self.dt, x, self.start)

    def past_sensitivity(self, step: Step, x: Floats, adjoint: Floats) -> PastSensitivity:
        """-rate m a / h by x_n."""
        weights, zero = -self.rate * self.masses / self.dt, np.zeros_like(self.start)
        return PastSensitivity(past_positions=weighted_difference(self.rows, weights, adjoint, zero))

    def hessian(self, x: Floats, project: bool = True) -> ElementHessian:
        """rate m / h on the diagonal [N/m]."""
        return diagonal_hessian(self.rows, self.rate * self.masses / self.dt)


@dataclass(frozen=True)
class Dampings(Energy, Restrictable):
    """Sum of several dampings."""

    parts: tuple[Energy, ...]

    incremental = True

    def begin(self, step: Step) -> Self:
        """A copy with each part bound to the step."""
        return replace(self, parts=tuple(part.begin(step) for part in self.parts))

    def restricted_to(self, moving: np.ndarray, x: Floats) -> Self:
        """A copy with each part restricted to the moving vertices."""
        return replace(self, parts=tuple(restricted(part, moving, x) for part in self.parts))

    def value(self, x: Floats) -> float:
        """Incremental dissipation [J]."""
        return sum(part.value(x) for part in self.parts)

    def gradient(self, x: Floats) -> Floats:
        """(N, 3) [N]."""
        return np.sum([part.gradient(x) for part in self.parts], axis=0)

    def hessian(self, x: Floats, project: bool = True) -> ElementHessian:
        """Blocks of one size [N/m]: a smaller one repeats its last vertex, with zeros."""
        hessians = [part.hessian(x, project) for part in self.parts]
        by_element = [h for h in hessians if isinstance(h, ByElement)]  # all of them
        size = max(h.elements.shape[1] for h in by_element)
        padded = [_padded(h, size) for h in by_element]
        elements, blocks = zip(*padded, strict=True)
        return ElementHessian(np.concatenate(elements), np.concatenate(blocks))


def damping(world: World, keys: Damping) -> Energy | Off:
    """Dampings of all cloths; those on strain and bending leave rigid motions undamped. Off where all three are 0."""
    rates = over_cloth("effects.damping.rate", keys.rate, world, least=0.0)
    beta = keys.stiffness
    eta = over_cloth("effects.damping.strain_rate", keys.strain_rate, world, least=0.0)
    shear, trace = eta + 2 * beta * world.per_triangle("shear_modulus"), beta * world.per_triangle("lame_modulus")
    parts: list[Energy] = []
    if rates.any():
        parts.append(_mass_damping(world, rates))
    if shear.any():
        parts.append(_strain_damping(world, shear, trace))
    if beta and world.hinges.stiffness.any():
        parts.append(_hinge_damping(world, beta))
    if not parts:
        given = beta > 0  # but no part of the fabric has a stiffness
        return Off("the fabric has no stiffness to be proportional to" if given else "rate is 0")
    return parts[0] if len(parts) == 1 else Dampings(tuple(parts))


def _mass_damping(world: World, rates: Floats) -> MassDamping:
    rows, start = every_vertex(world.n_cloth), world.start()[: world.n_cloth]
    if (rates == rates[0]).all():
        return MassDamping(rows, world.masses, float(rates[0]), start, 1.0)
    thirds = np.repeat(rates * world.per_triangle("density") * world.rest_areas / 3, 3)
    weights = np.bincount(world.triangles.ravel(), thirds, world.n_cloth).astype(np.float64)
    return MassDamping(rows, weights, 1.0, start, 1.0)


def _strain_damping(world: World, shear: Floats, trace: Floats) -> Energy:
    from clothsim.physics.energies.strain_damping import StrainDamping

    selected = np.flatnonzero(shear)
    inverses, areas = world.rest_shape_inverses[selected], world.rest_areas[selected]
    none = np.zeros((len(selected), 2, 2))
    return StrainDamping(world.triangles[selected], inverses, areas, shear[selected], trace[selected], none, 1.0)


def _hinge_damping(world: World, beta: float) -> Energy:
    from clothsim.physics.energies.hinge_bending import HingeBending, hinge_bending
    from clothsim.physics.energies.strain_damping import HingeDamping

    spring = hinge_bending(world.hinges)
    stiff = np.flatnonzero(spring.stiffnesses)
    hinges = HingeBending(spring.vertices[stiff], spring.rest_angles[stiff], spring.stiffnesses[stiff])
    return HingeDamping(beta * hinges.stiffnesses, hinges)


def _padded(hessian: ByElement, size: int) -> tuple[np.ndarray, Floats]:
    missing = size - hessian.elements.shape[1]
    if not missing:
        return hessian.elements, hessian.blocks
    last = np.repeat(hessian.elements[:, -1:], missing, axis=1)
    blocks = np.pad(hessian.blocks, ((0, 0), (0, 3 * missing), (0, 3 * missing)))
    return np.concatenate([hessian.elements, last], axis=1), blocks


EXAMPLE = Example(
    keys={"rate": 1.0, "stiffness": 0.3, "strain_rate": 0.2}, in_scene={"rate": 2.0}, zero={"rate": 0}, external=True
)
