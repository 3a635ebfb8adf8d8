"""The effect `self_contact`: intersection-free contact of cloth with itself and other cloth."""

from clothsim.keys.typed_effects import SelfContact
from clothsim.mesh.world import World
from clothsim.physics.contact.setup import with_offset_of_rods
from clothsim.physics.contact.surface import cloth_surface, excluded_pairs
from clothsim.physics.energies.base import Energy, Off
from clothsim.physics.energies.example import Example, Idle


def self_contact(world: World, keys: SelfContact) -> Energy | Off:
    """Log-barrier contact of every cloth with itself and with every other cloth; off where every pair is excluded.

    d_hat = "auto": a tenth of the median cloth edge, but at most half of the smallest rest gap of parts of a cloth
    without a common vertex, down to a tenth of that: slivers would else repel one another. A pair of one and the same
    name in `exclude` lets that cloth pass through itself. The surface of a rod is at its radius.

    Raises
    ------
    InputError
        Cloth starts in contact with cloth, or d_hat does not suit the mesh.

    Examples
    --------
    >>> import clothsim
    >>> from clothsim.scene.assembly.scene_world import build
    >>> sheet = {"mesh": "rectangle", "size": [1.0, 1.0], "cells": [10, 10]}
    >>> scene = clothsim.Scene(cloth=sheet, effects={"self_contact": {}})
    >>> build(scene).energies["self_contact"].d_hat
    0.01
    """
    surface = cloth_surface(world, excluded_pairs(world, keys))
    if not surface.allowed.any():
        return Off("every pair is excluded")
    keys = with_offset_of_rods(world, keys, 2)
    from clothsim.physics.contact.setup import (  # after the last Off: no kernel is imported without a pair
        contact_energy,
        d_hat_below_rest_gaps,
    )

    if keys.d_hat == "auto":
        keys = keys.with_keys(d_hat=d_hat_below_rest_gaps(world, surface))
    return contact_energy(world, keys, surface)


EXAMPLE = Example(
    keys={"d_hat": 0.4, "stiffness": 2.0},
    in_scene={},
    zero={"exclude": [["cloth", "cloth"]]},
    idle=Idle(
        scene={"body": {"position": [0.0, 0.0, -50.0]}},
        searches=True,
        kernels=("clothsim.physics.contact.barrier_kernels",),
    ),
)
