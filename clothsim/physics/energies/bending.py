"""Bending stiffness: the effect `bending`, with a choice of models."""

import importlib
from dataclasses import fields
from difflib import get_close_matches
from typing import Any

import numpy as np

from clothsim.base.errors import InputError
from clothsim.mesh.hinges import Hinges
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


def bending(world: World, *, model: str = "midedge", angle_degrees: Any = 0.0) -> Energy | Off:
    """The bending energy of all cloths, over the hinges that have a stiffness.

    Parameters
    ----------
    model : str
        "midedge" (curvature by triangle: convergent on any mesh, with the material's Poisson ratio), "hinge" (springs
        on dihedral angles) or "quadratic" (constant Hessian): the error of these two does not vanish with the mesh
        (docs/results/validation.md, A3), and they know the fabric's bending_stiffness alone.
    angle_degrees : number or values over the cloth
        Angle of the warp from the cloth's first axis (`kinematics.warp_weft`), for "midedge".

    Returns
    -------
    Energy, or Off without interior edges or stiffness.

    Raises
    ------
    InputError
        For an unknown model; names the nearest one. For an angle that the model does not take.
    """
    builder = _builder(model)
    turned = not (isinstance(angle_degrees, float | int) and angle_degrees == 0)
    if turned and model != "midedge":
        raise InputError(f'effects.bending.angle_degrees has no effect with model = "{model}".', 'It is for "midedge".')
    hinges = world.hinges
    if not len(hinges.vertices):
        return Off("the cloth has no interior edge")
    stiff = hinges.stiffness > 0
    if not stiff.any():
        return Off("bending stiffness is zero")
    stiff_hinges = Hinges(*(getattr(hinges, field.name)[stiff] for field in fields(hinges)))
    module, function = builder.split(":")
    build = getattr(importlib.import_module(module), function)
    if model != "midedge":
        return build(stiff_hinges, world)
    return build(stiff_hinges, world, np.radians(over_cloth("effects.bending.angle_degrees", angle_degrees, world)))


def _builder(name: str) -> str:
    """The builder of a model; InputError where there is none of this name."""
    if not isinstance(name, str) or name not in MODELS:
        nearest = get_close_matches(str(name), MODELS, n=1, cutoff=0.0)[0]
        raise InputError(
            f"There is no bending model {name!r}.", f"Did you mean {nearest!r}? Models: {', '.join(MODELS)}."
        )
    return MODELS[name]


EXAMPLE = Example(zero={}, zero_scene={"cloth": {"bending_stiffness": 0}})
