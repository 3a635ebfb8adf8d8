"""Pairs of objects that a contact effect excludes."""

from collections.abc import Sequence

import numpy as np

from clothsim.base.errors import InputError
from clothsim.keys.typed_effects import ContactKeys
from clothsim.mesh.world import World


def excluded_pairs(world: World, keys: ContactKeys) -> np.ndarray:
    """Excluded pairs of names as an (L, L) mask over the world's objects. InputError for an unknown name."""
    table = np.zeros((len(world.names),) * 2, bool)
    for number, pair in enumerate(keys.exclude):
        if isinstance(pair, str) or not isinstance(pair, Sequence) or len(pair) != 2:
            raise InputError(f"{keys.section}.exclude[{number}] must be two names, not {pair!r}.")
        unknown = [object_name for object_name in pair if object_name not in world.names]
        if unknown:
            raise InputError(
                f"{keys.section}.exclude[{number}]: unknown object {unknown[0]!r}.",
                f"Choose from: {', '.join(world.names)}.",
            )
        a, b = (world.names.index(object_name) for object_name in pair)
        table[a, b] = table[b, a] = True
    return table
