"""In-plane elasticity, stretch and shear: the effect `membrane`, with a choice of materials."""

from collections.abc import Mapping
from importlib import import_module

import numpy as np

from clothsim.base.errors import InputError
from clothsim.keys.typed_effects import Membrane
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Energy, Off
from clothsim.physics.energies.example import Example
from clothsim.physics.energies.key_values import over_cloth

MATERIALS: Mapping[str, tuple[str, ...]] = {
    "neo_hookean": ("elements", "compression"),
    "orthotropic": ("angle_degrees", "compression"),
    "measured": ("angle_degrees", "warp", "weft", "shear", "narrowing_warp", "narrowing_weft"),
}
"""Materials, and the keys that each of them takes."""

AUTO = "auto"
"""Each cloth by its fabric: orthotropic where that has stiffnesses of its own along warp and weft or in shear, else
isotropic. The isotropic sheet of the same Young's modulus has 210 times the shear stiffness of a woven table cloth.
"""
STIFFNESSES: Mapping[str, tuple[str, ...]] = {
    "neo_hookean": ("shear_modulus", "lame_modulus"),
    "orthotropic": ("stiffness_along_warp", "stiffness_along_weft", "stiffness_in_shear"),
}
"""Stiffnesses of a fabric that a material takes: a membrane without any of them is off."""

SLACK = "Young's modulus is 0"


def membrane(world: World, keys: Membrane) -> Energy | Off:
    """The membrane energy of all cloths; off where no fabric has a stiffness.

    Raises
    ------
    InputError
        For a key that the material does not take.
    """
    by_fabric, material = keys.material == AUTO, str(keys.material)
    if by_fabric:
        material = "orthotropic" if world.per_triangle("has_threads").any() else "neo_hookean"
    names = "warp", "weft", "shear", "narrowing_warp", "narrowing_weft"
    tables = {name: getattr(keys, name) for name in names}
    turned = not (isinstance(keys.angle_degrees, float | int) and keys.angle_degrees == 0)
    given = {"angle_degrees": turned, "elements": keys.elements != "triangles", "compression": keys.compression < 1}
    for key, is_given in (given | {key: np.size(table) > 0 for key, table in tables.items()}).items():
        if is_given and key not in MATERIALS[material]:
            others = " or ".join(f'"{name}"' for name, of_it in MATERIALS.items() if key in of_it)
            raise InputError(
                f'effects.membrane.{key} has no effect with material = "{material}".', f"It is for {others}."
            )
    angles = np.radians(over_cloth("effects.membrane.angle_degrees", keys.angle_degrees, world))
    own = STIFFNESSES.get(material)
    if own and not any(world.per_triangle(name).any() for name in own):
        return Off(SLACK)
    if keys.elements == "pairs" and keys.compression < 1:
        raise InputError("effects.membrane.compression is for single triangles.", 'Leave elements = "pairs" out.')
    if keys.elements == "pairs":  # each imported after the last Off: no kernel is imported for a zero
        from clothsim.physics.energies.paired_membrane import paired_membrane

        return paired_membrane(world)
    if material == "neo_hookean":
        fabrics = [each for cloth in world.cloths for each in ((cloth.name, cloth.fabric), *cloth.fabrics.items())]
        for name, fabric in fabrics:
            if fabric is not None and fabric.poisson_ratio < 0:  # E falls without bound as the cloth collapses
                raise InputError(
                    f'effects.membrane.material = "neo_hookean" does not take the poisson_ratio '
                    f"{fabric.poisson_ratio:g} of {name!r}.",
                    'Use material = "orthotropic", or leave it out.',
                )
        from clothsim.physics.energies.neo_hookean_membrane import NeoHookeanMembrane

        return _relaxed(NeoHookeanMembrane.of(world), keys.compression)
    if material == "orthotropic":
        from clothsim.physics.energies.woven_membrane import orthotropic

        return _relaxed(orthotropic(world, angles, by_fabric), keys.compression)
    from clothsim.physics.energies.measured_membrane import measured

    return measured(world, angles, **tables)


def _relaxed(membrane: Energy, compression: float) -> Energy:
    """The membrane with a fraction of its stiffness in compression; itself where that is 1."""
    if compression == 1:
        return membrane
    made: Energy = import_module("clothsim.physics.energies.tension_field").with_tension_field(membrane, compression)
    return made


EXAMPLE = Example(zero={}, zero_scene={"cloth": {"youngs_modulus": 0}})
