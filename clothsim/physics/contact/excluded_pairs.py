"""Pairs of objects that a contact effect excludes."""

from collections.abc import Sequence

import numpy as np

from clothsim.base.errors import InputError
from clothsim.mesh.world import World


def excluded_pairs(name: str, world: World, exclude: Sequence[Sequence[str]]) -> np.ndarray:
    """Excluded pairs of names as an (L, L) mask over the world's objects. InputError for an unknown name."""
    table = np.zeros((len(world.names),) * 2, bool)
    if isinstance(exclude, str) or not isinstance(exclude, Sequence):
        raise InputError(f"effects.{name}.exclude must be a list of pairs of names, not {exclude!r}.")
    for number, pair in enumerate(exclude):
        if isinstance(pair, str) or not isinstance(pair, Sequence) or len(pair) != 2:
            raise InputError(f"effects.{name}.exclude[{number}] must be two names, not {pair!r}.")
        unknown = [object_name for object_name in pair if object_name not in world.names]
        if unknown:
            raise InputError(
                f"effects.{name}.exclude[{number}]: unknown object {unknown[0]!r}.",
                f"Choose from: {', '.join(world.names)}.",
            )
        a, b = (world.names.index(object_name) for object_name in pair)
        table[a, b] = table[b, a] = True
    return table
