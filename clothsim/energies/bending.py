"""Bending stiffness: the effect `bending`, with a choice of models."""

import importlib
from dataclasses import fields
from difflib import get_close_matches

from clothsim.energies.base import Energy, Off
from clothsim.energies.example import Example
from clothsim.errors import InputError
from clothsim.mesh.hinges import Hinges
from clothsim.mesh.world import World

MODELS = {
    "midedge": "clothsim.energies.midedge_bending:midedge_bending",
    "hinge": "clothsim.energies.hinge_bending:hinge_bending",
    "quadratic": "clothsim.energies.quadratic_bending:quadratic_bending",
}
"""Bending models by name: the function that builds the energy of hinges of a world, imported when it is chosen."""


def bending(world: World, *, model: str = "midedge") -> Energy | Off:
    """The bending energy of all cloths, over the hinges that have a stiffness.

    Parameters
    ----------
    model : str
        "midedge" (curvature by triangle: convergent on any mesh, with the material's Poisson ratio), "hinge" (springs
        on dihedral angles) or "quadratic" (constant Hessian): the error of these two does not vanish with the mesh
        (docs/validation.md, A3).

    Returns
    -------
    Energy, or Off without interior edges or stiffness.

    Raises
    ------
    InputError
        For an unknown model; names the nearest one.
    """
    builder = _builder(model)
    hinges = world.hinges
    if not len(hinges.vertices):
        return Off("the cloth has no interior edge")
    stiff = hinges.stiffness > 0
    if not stiff.any():
        return Off("bending stiffness is zero")
    stiff_hinges = Hinges(*(getattr(hinges, field.name)[stiff] for field in fields(hinges)))
    module, function = builder.split(":")
    return getattr(importlib.import_module(module), function)(stiff_hinges, world)


def _builder(name: str) -> str:
    """The builder of a model; InputError where there is none of this name."""
    if not isinstance(name, str) or name not in MODELS:
        nearest = get_close_matches(str(name), MODELS, n=1, cutoff=0.0)[0]
        raise InputError(
            f"There is no bending model {name!r}.", f"Did you mean {nearest!r}? Models: {', '.join(MODELS)}."
        )
    return MODELS[name]


EXAMPLE = Example(zero={}, zero_scene={"cloth": {"bending_stiffness": 0}})
