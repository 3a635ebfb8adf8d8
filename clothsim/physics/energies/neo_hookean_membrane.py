"""Constant-strain triangles of the compressible Neo-Hookean sheet (`triangle_kernels`)."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.mesh.world import World
from clothsim.physics.energies import membrane_kernels as kernels
from clothsim.physics.energies.base import Energy
from clothsim.physics.energies.hessians import LanesHessian
from clothsim.physics.energies.protocols import Elementwise


@dataclass(frozen=True)
class NeoHookeanMembrane(Elementwise, Energy):
    """E = sum of A psi(F), psi = mu/2 (tr F'F - 2 - 2 ln J) + lam/2 (ln J)^2, J^2 = det F'F; +inf where an area is 0.

    Parameters
    ----------
    triangles : (m, 3) int array
        Rows of x.
    rest_shape_inverses : (m, 2, 2) array
        Dm^-1 [1/m].
    rest_areas : (m,) array
        A [m2].
    mu, lam : (m,) arrays
        Lame parameters of the sheet [N/m].
    """

    triangles: Ints
    rest_shape_inverses: Floats
    rest_areas: Floats
    mu: Floats
    lam: Floats

    per_element = ("triangles", "rest_shape_inverses", "rest_areas", "mu", "lam")

    @classmethod
    def of(cls, world: World) -> Self:
        """The membrane of every triangle that has a stiffness."""
        mu, lam = world.per_triangle("shear_modulus"), world.per_triangle("lame_modulus")
        stiff = np.flatnonzero((mu != 0) | (lam != 0))
        return cls(
            world.triangles[stiff], world.rest_shape_inverses[stiff], world.rest_areas[stiff], mu[stiff], lam[stiff]
        )

    def value(self, x: Floats) -> float:
        """Elastic energy [J]; +inf where a triangle has lost its area."""
        return kernels.value(x, *self.elements)

    def gradient(self, x: Floats) -> Floats:
        """dE/dx, (N, 3) [N]."""
        return kernels.gradient(x, *self.elements)

    def hessian(self, x: Floats, project: bool = True) -> LanesHessian:
        """Blocks (m, 9, 9) [N/m]; projected in F-space in closed form, or exact."""
        given = x, *self.elements, project
        return LanesHessian(
            self.triangles,
            lambda lanes, first: kernels.fill(lanes, first, *given),
            lambda data, at: kernels.add_triangles(data, at, *given),
        )

    def with_triangles(self, triangles: Ints) -> Self:
        """Return the same elements between other vertices, `triangles (m, 3)`."""
        return replace(self, triangles=triangles)

    @property
    def elements(self) -> tuple[Ints, Floats, Floats, Floats, Floats]:
        """What the kernels take of each triangle."""
        return self.triangles, self.rest_shape_inverses, self.rest_areas, self.mu, self.lam
