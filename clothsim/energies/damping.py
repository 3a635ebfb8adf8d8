"""The effect `damping`: drags that let a drape settle, on velocity, on the rate of strain and on that of folding."""

from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from clothsim.arrays import Floats, Ints, as_positive
from clothsim.energies.base import Energy, Off
from clothsim.energies.diagonal import diagonal_hessian, every_vertex, weighted_difference, weighted_square
from clothsim.energies.elementwise import Elementwise
from clothsim.energies.example import Example
from clothsim.energies.hessians import ByElement, ElementHessian
from clothsim.energies.hinge_bending import HingeBending, hinge_bending
from clothsim.energies.protocols import Restrictable, restricted
from clothsim.energies.step import Step
from clothsim.energies.strain_damping import HingeDamping, StrainDamping
from clothsim.energies.varying_values import over_cloth
from clothsim.mesh.world import World


@dataclass(frozen=True)
class MassDamping(Elementwise, Energy):
    """E = rate sum m |x - x_n|^2 / (2 h): the force is -rate m v (Rayleigh's mass term).

    rows (n, 1) of x; masses (n,) [kg]; rate [1/s]; start x_n (n, 3) [m] and dt h [s] of the step; in BDF2 x^ and
    b h (docs/theory.md#time-integration).
    """

    rows: Ints
    masses: Floats
    rate: float
    start: Floats
    dt: float

    per_element = ("rows", "masses", "start")
    incremental = True

    def begin(self, step: Step) -> Self:
        """Bound to x_n and h of the step."""
        past = step.past
        return replace(self, start=past.positions[self.rows[:, 0]], dt=past.dt)

    def value(self, x: Floats) -> float:
        """Incremental dissipation [J]."""
        return self.rate * weighted_square(self.rows, self.masses, x, self.start) / (2 * self.dt)

    def gradient(self, x: Floats) -> Floats:
        """rate m (x - x_n) / h, (N, 3) [N]."""
        return weighted_difference(self.rows, self.rate * self.masses / self.dt, x, self.start)

    def hessian(self, x: Floats, project: bool = True) -> ElementHessian:
        """rate m / h on the diagonal [N/m]."""
        return diagonal_hessian(self.rows, self.rate * self.masses / self.dt)


@dataclass(frozen=True)
class Dampings(Energy, Restrictable):
    """The sum of several drags."""

    parts: tuple[Energy, ...]

    incremental = True

    def begin(self, step: Step) -> Self:
        """Each bound to the step."""
        return replace(self, parts=tuple(part.begin(step) for part in self.parts))

    def restricted_to(self, moving: np.ndarray, x: Floats) -> Self:
        """Each around what moves."""
        return replace(self, parts=tuple(restricted(part, moving, x) for part in self.parts))

    def value(self, x: Floats) -> float:
        """Incremental dissipation [J]."""
        return sum(part.value(x) for part in self.parts)

    def gradient(self, x: Floats) -> Floats:
        """(N, 3) [N]."""
        return np.sum([part.gradient(x) for part in self.parts], axis=0)

    def hessian(self, x: Floats, project: bool = True) -> ElementHessian:
        """All blocks in the size of the largest [N/m]: a smaller one repeats its last vertex, with zeros."""
        hessians = [part.hessian(x, project) for part in self.parts]
        size = max(h.elements.shape[1] for h in hessians)
        padded = [_padded(h, size) for h in hessians]
        elements, blocks = zip(*padded, strict=True)
        return ElementHessian(np.concatenate(elements), np.concatenate(blocks))


def damping(world: World, *, rate: Any = 1.0, stiffness: float = 0.0, strain_rate: Any = 0.0) -> Energy | Off:
    """Three drags; off where all of them are 0.

    rate [1/s], 1 where it is not given: proportional to mass and velocity, it also slows a free fall. stiffness [s]:
    Rayleigh's beta, proportional to the stiffness of the fabric in its plane and about its hinges. strain_rate [N s/m]:
    on the rate of strain in the plane. The last two leave rigid motions alone. rate and strain_rate may vary over the
    cloth (`energies.values`).
    """
    rates = over_cloth("effects.damping.rate", rate, world, least=0.0)
    beta = as_positive("effects.damping.stiffness", stiffness, zero=True)
    eta = over_cloth("effects.damping.strain_rate", strain_rate, world, least=0.0)
    shear, trace = eta + 2 * beta * world.per_triangle("shear_modulus"), beta * world.per_triangle("lame_modulus")
    spring = hinge_bending(world.hinges)
    parts: list[Energy] = []
    if rates.any():
        parts.append(_mass_damping(world, rates))
    if shear.any():
        parts.append(_strain_damping(world, shear, trace))
    if beta and spring.stiffnesses.any():
        parts.append(_hinge_damping(spring, beta))
    if not parts:
        given = beta > 0  # and nothing is stiff
        return Off("the fabric has no stiffness to be proportional to" if given else "rate is 0")
    return parts[0] if len(parts) == 1 else Dampings(tuple(parts))


def _mass_damping(world: World, rates: Floats) -> MassDamping:
    rows, start = every_vertex(world.n_cloth), world.start()[: world.n_cloth]
    if (rates == rates[0]).all():
        return MassDamping(rows, world.masses, float(rates[0]), start, 1.0)
    thirds = np.repeat(rates * world.per_triangle("density") * world.rest_areas / 3, 3)
    weights = np.bincount(world.triangles.ravel(), thirds, world.n_cloth).astype(np.float64)
    return MassDamping(rows, weights, 1.0, start, 1.0)


def _strain_damping(world: World, shear: Floats, trace: Floats) -> StrainDamping:
    felt = np.flatnonzero(shear)
    inverses, areas = world.rest_shape_inverses[felt], world.rest_areas[felt]
    none = np.zeros((len(felt), 2, 2))
    return StrainDamping(world.triangles[felt], inverses, areas, shear[felt], trace[felt], none, 1.0)


def _hinge_damping(spring: HingeBending, beta: float) -> HingeDamping:
    felt = np.flatnonzero(spring.stiffnesses)
    kept = HingeBending(spring.vertices[felt], spring.rest_angles[felt], spring.stiffnesses[felt])
    return HingeDamping(beta * kept.stiffnesses, kept)


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
