"""The effect `membrane`: a sheet resists stretch and shear in its own plane."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from clothsim.arrays import Floats, Ints
from clothsim.energies import membrane_kernels as kernels
from clothsim.energies.base import Energy, Off
from clothsim.energies.elementwise import Elementwise
from clothsim.energies.example import Example
from clothsim.energies.hessians import LanesHessian
from clothsim.energies.varying_values import over_cloth
from clothsim.errors import InputError
from clothsim.mesh.world import World


@dataclass(frozen=True)
class NeoHookeanMembrane(Elementwise, Energy):
    """E = sum over triangles of A psi(F), psi the Neo-Hookean density of `neo_hookean`.

    triangles (m, 3); rest_shape_inverses Dm^-1 (m, 2, 2) [1/m]; rest_areas (m,) [m2]; mu, lam (m,) [N/m].
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
        return kernels.value(x, *self._elements)

    def gradient(self, x: Floats) -> Floats:
        """dE/dx, (N, 3) [N]."""
        return kernels.gradient(x, *self._elements)

    def hessian(self, x: Floats, project: bool = True) -> LanesHessian:
        """Blocks (m, 9, 9) [N/m]; projected in F-space in closed form, or exact."""
        elements = self._elements
        return LanesHessian(self.triangles, lambda lanes, first: kernels.fill(lanes, first, x, *elements, project))

    def with_triangles(self, triangles: Ints) -> Self:
        """The same elements between other vertices, `triangles (m, 3)`."""
        return replace(self, triangles=triangles)

    @property
    def _elements(self) -> tuple[Ints, Floats, Floats, Floats, Floats]:
        return self.triangles, self.rest_shape_inverses, self.rest_areas, self.mu, self.lam


MATERIALS: Mapping[str, tuple[str, ...]] = {
    "neo_hookean": ("elements",),
    "orthotropic": ("angle_degrees",),
    "measured": ("angle_degrees", "warp", "weft", "shear"),
}
"""The materials, and the keys that each of them has."""
ELEMENTS = ("triangles", "pairs")
SLACK = "Young's modulus is 0"


def membrane(
    world: World,
    *,
    material: str = "neo_hookean",
    angle_degrees: Any = 0.0,
    warp: ArrayLike = (),
    weft: ArrayLike = (),
    shear: ArrayLike = (),
    elements: str = "triangles",
) -> Energy | Off:
    """The membrane energy of all cloths; off where no fabric has a stiffness.

    material: "neo_hookean" (alike in all directions), "orthotropic" (the fabric's warp, weft and shear stiffness; see
    `orthotropic`) or "measured" (tables of strain and stress [N/m] along warp, weft and in shear; see `measured`).
    angle_degrees turns the warp from the cloth's first axis (`kinematics.threads`) and may vary over the cloth.
    elements: "triangles", or "pairs" of them, which lock less where folds are as fine as the mesh (`paired_membrane`).
    """
    if not isinstance(material, str) or material not in MATERIALS:
        raise InputError(f"effects.membrane.material is {material!r}.", f"Known: {', '.join(MATERIALS)}.")
    if not isinstance(elements, str) or elements not in ELEMENTS:
        raise InputError(f"effects.membrane.elements is {elements!r}.", f"Known: {', '.join(ELEMENTS)}.")
    tables = {"warp": warp, "weft": weft, "shear": shear}
    turned = not (isinstance(angle_degrees, float | int) and angle_degrees == 0)
    given = {"angle_degrees": turned, "elements": elements != "triangles"}
    _refuse_others(material, given | {key: np.size(table) > 0 for key, table in tables.items()})
    energy: Any
    if elements == "pairs":
        from clothsim.energies.paired_membrane import paired_membrane

        energy = paired_membrane(world)
        return energy if len(energy.elements) else Off(SLACK)
    if material == "neo_hookean":
        energy = NeoHookeanMembrane.of(world)
    else:
        angles = np.radians(over_cloth("effects.membrane.angle_degrees", angle_degrees, world))
        if material == "orthotropic":
            from clothsim.energies.orthotropic import orthotropic

            energy = orthotropic(world, angles)
        else:
            from clothsim.energies.measured_membrane import measured

            energy = measured(world, angles, **tables)
    return energy if len(energy.triangles) else Off(SLACK)


def _refuse_others(material: str, given: Mapping[str, bool]) -> None:
    """InputError for a key that is given and that the material has not."""
    for key, is_given in given.items():
        if is_given and key not in MATERIALS[material]:
            others = " or ".join(f'"{name}"' for name, keys in MATERIALS.items() if key in keys)
            raise InputError(
                f'effects.membrane.{key} does nothing with material = "{material}".', f"It is for {others}."
            )


EXAMPLE = Example(zero={}, zero_scene={"cloth": {"youngs_modulus": 0}})
