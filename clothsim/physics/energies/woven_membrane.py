"""Membranes of warp and weft threads: constitutive laws over stretches and shear, beside a Neo-Hookean sheet."""

from dataclasses import dataclass, fields, replace
from typing import Protocol, Self

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.geometry.kinematics.deformation_gradient import thread_axes
from clothsim.mesh.world import World
from clothsim.physics.energies import fibre_kernels as kernels
from clothsim.physics.energies.base import Energy
from clothsim.physics.energies.hessians import DeferredHessian, ElementHessian, room_for
from clothsim.physics.energies.neo_hookean_membrane import NeoHookeanMembrane
from clothsim.physics.energies.protocols import EnergyReport, Restrictable


class ThreadLaw(Protocol):
    """A constitutive law of threads: energy density over la, lb, I8 (m, 3), triangle by triangle."""

    def density(self, measured: Floats) -> Floats:
        """psi, (m,) [J/m2]."""

    def slopes(self, measured: Floats) -> Floats:
        """d psi/d(la, lb, I8), (m, 3) [N/m]."""

    def curvatures(self, measured: Floats) -> Floats:
        """The second derivatives aa, ab, bb and 88, (m, 4) [N/m]; those of I8 with la and lb must be 0."""

    def of(self, triangles: Ints) -> Self:
        """The law restricted to some triangles, by their numbers."""


ARRAYS = "triangles", "inverses", "areas"


@dataclass(frozen=True)
class LinearThreads:
    """Linear threads: stiffnesses warp Ka, weft Kb, coupled Kab and shear G, (m,) [N/m]."""

    warp: Floats
    weft: Floats
    coupled: Floats
    shear: Floats

    def of(self, triangles: Ints) -> Self:
        """The stiffnesses of some triangles."""
        return replace(self, **{field.name: getattr(self, field.name)[triangles] for field in fields(self)})

    def density(self, measured: Floats) -> Floats:
        """psi, (m,) [J/m2]."""
        strain, slopes = self._strain(measured), self.slopes(measured)
        return 0.5 * (strain * slopes).sum(axis=1)

    def slopes(self, measured: Floats) -> Floats:
        """Nominal stresses of the threads and shear stress, (m, 3) [N/m]."""
        a, b, shear = self._strain(measured).T
        stress_a, stress_b = self.warp * a + self.coupled * b, self.coupled * a + self.weft * b
        return np.column_stack([stress_a, stress_b, self.shear * shear])

    def curvatures(self, measured: Floats) -> Floats:
        """The stiffnesses, (m, 4) [N/m]."""
        return np.column_stack([self.warp, self.coupled, self.weft, self.shear])

    def _strain(self, measured: Floats) -> Floats:
        return measured - np.array([1.0, 1.0, 0.0])


@dataclass(frozen=True)
class FibresEnergy(Energy, Restrictable):
    """E = sum over triangles of A psi(la, lb, I8).

    Parameters
    ----------
    triangles : (m, 3) int array
        Rows of x.
    inverses : (m, 2, 2) array
        Dm^-1 [a b] [1/m].
    areas : (m,) array
        A at rest [m2].
    law : ThreadLaw
        psi and its derivatives.
    """

    triangles: Ints
    inverses: Floats
    areas: Floats
    law: ThreadLaw

    @classmethod
    def of(cls, world: World, chosen: Ints, angles: Floats, law: ThreadLaw) -> Self:
        """The threads of the `chosen (k,)` triangles of a world; angles (m,) of the warp [rad], of all of them."""
        inverses = world.rest_shape_inverses @ thread_axes(world, angles)
        return cls(world.triangles[chosen], inverses[chosen], world.rest_areas[chosen], law)

    def reads_beyond(self, n: int) -> bool:
        """True where a triangle has a row from n on."""
        return bool(self.triangles.max(initial=-1) >= n)

    def restricted_to(self, moving: np.ndarray, x: Floats) -> Self:
        """The threads of the triangles with a moving vertex."""
        selected = np.flatnonzero(moving[self.triangles].any(axis=1))
        return replace(self, law=self.law.of(selected), **{name: getattr(self, name)[selected] for name in ARRAYS})

    def measured(self, x: Floats) -> Floats:
        """la, lb, I8 of each triangle, (m, 3)."""
        return kernels.measures(x, self.triangles, self.inverses)

    def value(self, x: Floats) -> float:
        """Elastic energy [J]."""
        return float(np.sum(self.areas * self.law.density(self.measured(x))))

    def gradient(self, x: Floats) -> Floats:
        """dE/dx, (N, 3) [N]."""
        measured = self.measured(x)
        slopes = self.areas[:, None] * self.law.slopes(measured)
        return kernels.gradient(x, self.triangles, self.inverses, measured, slopes)

    def hessian(self, x: Floats, project: bool = True) -> ElementHessian:
        """Blocks (m, 9, 9) [N/m]; projected over (F a, F b) in closed form, or exact."""
        return ElementHessian(self.triangles, kernels.hessian(x, self.triangles, *self.derivatives(x), project))

    def derivatives(self, x: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """`inverses`, measures, and the first and second derivatives by them, (m, 3) and (m, 4) [N m]."""
        measured, areas = self.measured(x), self.areas[:, None]
        return self.inverses, measured, areas * self.law.slopes(measured), areas * self.law.curvatures(measured)


# Orthotropic membrane of woven and knitted sheets: stiffness along warp and weft, and in shear.
#
# For small strains it is orthotropic plane stress: with the stiffnesses E1 along the warp, E2 along the weft and G in
# shear [N/m] and nu^2 = nu12 nu21 (nu12 E2 = nu21 E1, so nu12 = nu sqrt(E1/E2)),
#
#     C11 = E1/(1 - nu^2),  C22 = E2/(1 - nu^2),  C12 = nu sqrt(E1 E2)/(1 - nu^2),  C33 = G
#
# which is stable for every |nu| < 1. The energy is the sum of a Neo-Hookean sheet of shear modulus mu and lam = 0,
# which prevents collapsed triangles and resists shear, and of threads with the remaining stiffness C -
# diag(2 mu, 2 mu, mu): mu = min(G, half the smaller eigenvalue of [[C11, C12], [C12, C22]]) is the largest for which it
# is semi-definite. For E1 = E2 = 2 (1 + nu) G the small-strain limit is that of the isotropic membrane.


@dataclass(frozen=True)
class ThreadedMembrane(Energy, Restrictable, EnergyReport):
    """A Neo-Hookean sheet with threads over the same triangles; `notes`: its report of defaults used."""

    sheet: NeoHookeanMembrane
    threads: FibresEnergy
    notes: tuple[str, ...] = ()

    @classmethod
    def of(
        cls,
        world: World,
        chosen: Ints,
        angles: Floats,
        lame: tuple[Floats, Floats],
        law: ThreadLaw,
        notes: tuple[str, ...] = (),
    ) -> Self:
        """The `chosen (k,)` triangles of a world; mu and lam (k,) of the sheet [N/m], angles (m,) of the warp [rad]."""
        shapes, areas = world.rest_shape_inverses[chosen], world.rest_areas[chosen]
        sheet = NeoHookeanMembrane(world.triangles[chosen], shapes, areas, *lame)
        return cls(sheet, FibresEnergy.of(world, chosen, angles, law), notes)

    @property
    def triangles(self) -> Ints:
        """The elastic triangles, (m, 3)."""
        return self.sheet.triangles

    def reads_beyond(self, n: int) -> bool:
        """True where a triangle has a row from n on."""
        return self.sheet.reads_beyond(n)

    def with_triangles(self, triangles: Ints) -> Self:
        """Copy of the elements between other vertices, `triangles (m, 3)`."""
        threads = replace(self.threads, triangles=triangles)
        return replace(self, sheet=self.sheet.with_triangles(triangles), threads=threads)

    def defaults_used(self) -> tuple[str, ...]:
        """The notes of the material."""
        return self.notes

    def restricted_to(self, moving: np.ndarray, x: Floats) -> Self:
        """Both parts over the triangles with a moving vertex."""
        return replace(self, sheet=self.sheet.restricted_to(moving, x), threads=self.threads.restricted_to(moving, x))

    def value(self, x: Floats) -> float:
        """Elastic energy [J]; +inf where a triangle has lost its area."""
        value = self.sheet.value(x)
        return value + self.threads.value(x) if np.isfinite(value) else value

    def gradient(self, x: Floats) -> Floats:
        """dE/dx, (N, 3) [N]."""
        return self.sheet.gradient(x) + self.threads.gradient(x)

    def hessian(self, x: Floats, project: bool = True) -> ElementHessian | DeferredHessian:
        """Blocks (m, 9, 9) [N/m]; each part projected in closed form, or exact."""
        threads = self.threads.derivatives(x)

        def fill(blocks: Floats) -> None:
            blocks[:] = self.sheet.hessian(x, project).blocks
            blocks += kernels.hessian(x, self.threads.triangles, *threads, project)

        if type(self.sheet) is not NeoHookeanMembrane:  # one that is relaxed in compression
            blocks = room_for(self.triangles)
            fill(blocks)
            return ElementHessian(self.triangles, blocks)
        return DeferredHessian(
            self.triangles,
            fill,
            lambda data, at: kernels.add_threaded(data, at, x, *self.sheet.elements, *threads, project),
        )


def orthotropic(world: World, angles: Floats, by_fabric: bool = False) -> ThreadedMembrane:
    """The sheets of all fabrics that have a stiffness; angles (m,) of the warp [rad].

    by_fabric: a fabric without stiffnesses of threads stays an isotropic Neo-Hookean sheet, beside others that have
    them; else it becomes the orthotropic sheet with the same limit of small strains.
    """
    warp, weft = world.per_triangle("stiffness_along_warp"), world.per_triangle("stiffness_along_weft")
    shear, nu = world.per_triangle("stiffness_in_shear"), world.per_triangle("poisson_ratio_of_threads")
    chosen = np.flatnonzero(warp + weft + shear)
    warp, weft, shear, nu = warp[chosen], weft[chosen], shear[chosen], nu[chosen]
    c11, c22, c12 = warp / (1 - nu**2), weft / (1 - nu**2), nu * np.sqrt(warp * weft) / (1 - nu**2)
    smaller = 0.5 * (c11 + c22) - np.hypot(0.5 * (c11 - c22), c12)
    mu = np.minimum(shear, 0.5 * np.maximum(smaller, 0.0))
    lam, stiffnesses = np.zeros(len(chosen)), [c11 - 2 * mu, c22 - 2 * mu, c12, shear - mu]
    if by_fabric:
        threaded = world.per_triangle("has_threads")[chosen]
        mu = np.where(threaded, mu, world.per_triangle("shear_modulus")[chosen])
        lam = np.where(threaded, lam, world.per_triangle("lame_modulus")[chosen])
        stiffnesses = [np.where(threaded, each, 0.0) for each in stiffnesses]
    return ThreadedMembrane.of(world, chosen, angles, (mu, lam), LinearThreads(*stiffnesses))
