"""Energies of warp and weft threads: constitutive laws over stretches and shear, summed over triangles."""

from dataclasses import dataclass, fields, replace
from typing import Protocol, Self

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.geometry.kinematics.warp_weft import thread_axes
from clothsim.mesh.world import World
from clothsim.physics.energies import fibre_kernels as kernels
from clothsim.physics.energies.base import Energy
from clothsim.physics.energies.hessians import ElementHessian
from clothsim.physics.energies.protocols import Restrictable


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
        measured, areas = self.measured(x), self.areas[:, None]
        slopes, curvatures = areas * self.law.slopes(measured), areas * self.law.curvatures(measured)
        blocks = kernels.hessian(x, self.triangles, self.inverses, measured, slopes, curvatures, project)
        return ElementHessian(self.triangles, blocks)
