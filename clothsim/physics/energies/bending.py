"""Bending stiffness: the effect `bending`, with a choice of models."""

import importlib
from dataclasses import fields

import numpy as np

from clothsim.base.errors import InputError
from clothsim.keys.typed_effects import Bending
from clothsim.mesh.cloth import Hinges
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Energy, Off
from clothsim.physics.energies.example import Example
from clothsim.physics.energies.varying_values import over_cloth

MODELS = {
    "midedge": "clothsim.physics.energies.midedge_bending:midedge_bending",
    "hinge": "clothsim.physics.energies.hinge_bending:hinge_bending",
    "quadratic": "clothsim.physics.energies.quadratic_bending:quadratic_bending",
}
"""Bending models by name: the function that builds the energy of hinges of a world, imported when it is chosen."""


def bending(world: World, keys: Bending) -> Energy | Off:
    """The bending energy of all cloths, over the hinges that have a stiffness; off without such.

    "midedge" has the curvature by triangle: convergent on any mesh, with the material's Poisson ratio. The error of
    "hinge" (springs on dihedral angles) and "quadratic" (constant Hessian) does not vanish with the mesh
    (docs/results/validation.md, A3), and they know the fabric's bending_stiffness alone.

    Raises
    ------
    InputError
        For a key that the model does not take.
    """
    turned = not (isinstance(keys.angle_degrees, float | int) and keys.angle_degrees == 0)
    for key, given in {"angle_degrees": turned, "curvature_jumps": keys.curvature_jumps != 0}.items():
        if given and keys.model != "midedge":
            raise InputError(
                f'effects.bending.{key} has no effect with model = "{keys.model}".', 'It is for "midedge".'
            )
    hinges = world.hinges
    if not len(hinges.vertices):
        return Off("the cloth has no interior edge")
    stiff = hinges.stiffness > 0
    if not stiff.any():
        return Off("bending stiffness is zero")
    stiff_hinges = Hinges(*(getattr(hinges, field.name)[stiff] for field in fields(hinges)))
    module, function = MODELS[keys.model].split(":")
    build = getattr(importlib.import_module(module), function)
    if keys.model != "midedge":
        return build(stiff_hinges, world)
    angles = over_cloth("effects.bending.angle_degrees", keys.angle_degrees, world)
    return build(stiff_hinges, world, np.radians(angles), keys.curvature_jumps)


EXAMPLE = Example(zero={}, zero_scene={"cloth": {"bending_stiffness": 0}})
