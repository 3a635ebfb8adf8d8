"""Bending stiffness: the effect `bending`, with a choice of models."""

from collections.abc import Callable
from dataclasses import fields
from difflib import get_close_matches

from clothsim.energies.base import Energy, Off
from clothsim.energies.example import Example
from clothsim.energies.hinge_bending import hinge_bending
from clothsim.energies.midedge_bending import midedge_bending
from clothsim.energies.quadratic_bending import quadratic_bending
from clothsim.errors import InputError
from clothsim.mesh.hinges import Hinges
from clothsim.mesh.world import World

MODELS: dict[str, Callable[[Hinges, World], Energy]] = {
    "hinge": lambda hinges, world: hinge_bending(hinges),
    "quadratic": lambda hinges, world: quadratic_bending(hinges, world.start()),
    "midedge": midedge_bending,
}
"""Bending models by name: each builds the energy of hinges of a world."""


def bending(world: World, *, model: str = "hinge") -> Energy | Off:
    """The bending energy of all cloths, over the hinges that have a stiffness.

    Parameters
    ----------
    model : str
        "hinge" (springs on dihedral angles), "quadratic" (constant Hessian) or "midedge" (convergent on any mesh, with
        the material's Poisson ratio).

    Returns
    -------
    Energy, or Off without interior edges or stiffness.

    Raises
    ------
    InputError
        For an unknown model; names the nearest one.
    """
    build = _model(model)
    hinges = world.hinges
    if not len(hinges.vertices):
        return Off("the cloth has no interior edge")
    stiff = hinges.stiffness > 0
    if not stiff.any():
        return Off("bending stiffness is zero")
    kept = Hinges(*(getattr(hinges, field.name)[stiff] for field in fields(hinges)))
    return build(kept, world)


def _model(name: str) -> Callable[[Hinges, World], Energy]:
    if not isinstance(name, str) or name not in MODELS:
        nearest = get_close_matches(str(name), MODELS, n=1, cutoff=0.0)[0]
        raise InputError(
            f"There is no bending model {name!r}.", f"Did you mean {nearest!r}? Models: {', '.join(MODELS)}."
        )
    return MODELS[name]


EXAMPLE = Example(zero={}, zero_scene={"cloth": {"bending_stiffness": 0}})
