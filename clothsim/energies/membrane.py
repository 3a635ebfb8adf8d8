"""The effect `membrane`: a sheet resists stretch and shear in its own plane."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.energies import membrane_kernels as kernels
from clothsim.energies.base import ElementHessian, Energy, Off
from clothsim.errors import InputError
from clothsim.mesh.world import World


@dataclass(frozen=True)
class NeoHookeanMembrane(Energy):
    """E = sum over triangles of A psi(F), psi the Neo-Hookean density of `neo_hookean`.

    triangles (m, 3); rest_shape_inverses Dm^-1 (m, 2, 2) [1/m]; rest_areas (m,) [m2]; mu, lam (m,) [N/m].
    """

    triangles: Ints
    rest_shape_inverses: Floats
    rest_areas: Floats
    mu: Floats
    lam: Floats

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
        return kernels.value(x, *self._elements)

    def gradient(self, x: Floats) -> Floats:
        """dE/dx, (N, 3) [N]."""
        return kernels.gradient(x, *self._elements)

    def hessian(self, x: Floats, project: bool = True) -> ElementHessian:
        """Blocks (m, 9, 9) [N/m]; projected in F-space in closed form, or exact."""
        return ElementHessian(self.triangles, kernels.hessian(x, *self._elements, project))

    @property
    def _elements(self) -> tuple[Ints, Floats, Floats, Floats, Floats]:
        return self.triangles, self.rest_shape_inverses, self.rest_areas, self.mu, self.lam


MATERIALS = {"neo_hookean": NeoHookeanMembrane}


def membrane(world: World, *, material: str = "neo_hookean") -> Energy | Off:
    """The membrane energy of all cloths; off where every fabric has Young's modulus 0."""
    if not isinstance(material, str) or material not in MATERIALS:
        raise InputError(f"effects.membrane.material is {material!r}.", f"Known: {', '.join(MATERIALS)}.")
    energy = MATERIALS[material].of(world)
    return energy if len(energy.triangles) else Off("Young's modulus is 0")
