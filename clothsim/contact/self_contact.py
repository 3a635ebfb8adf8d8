"""The effect `self_contact`: cloth intersects neither itself nor other cloth."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from clothsim.contact.candidates import Candidates
from clothsim.contact.setup import contact_energy, edge_lengths, excluded_pairs
from clothsim.contact.stiffness import default_d_hat
from clothsim.contact.surface import ContactSurface, cloth_surface
from clothsim.energies.base import Energy, Off
from clothsim.energies.example import Example, Idle
from clothsim.mesh.world import World


def self_contact(
    world: World,
    *,
    d_hat: float | str = "auto",
    offset: float = 0.0,
    stiffness: float | str = "auto",
    exclude: Sequence[Sequence[str]] = (),
    backend: str = "auto",
) -> Energy | Off:
    """Log-barrier contact of every cloth with itself and with every other; keys as for `body_contact`.

    A pair of one and the same name in `exclude` lets that cloth pass through itself. "auto" also keeps d_hat below
    half of the smallest gap between parts of a cloth at rest that share no vertex, down to a tenth: slivers would else
    push one another apart.
    """
    surface = cloth_surface(world, excluded_pairs("self_contact", world, exclude))
    if not surface.allowed.any():
        return Off("every pair is excluded")
    if d_hat == "auto":
        d_hat = _below_rest_gaps(world, surface)
    return contact_energy("self_contact", world, surface, d_hat, offset, stiffness, backend)


def _below_rest_gaps(world: World, surface: ContactSurface) -> float:
    """A tenth of the median edge, or half of the smallest gap at rest of parts of one cloth where that is less."""
    usual = default_d_hat(edge_lengths(world))
    one_by_one = replace(surface, allowed=surface.allowed & np.eye(len(surface.allowed), dtype=bool))
    gap = Candidates(one_by_one, usual, reach=0.0).minimum_gap(surface.rest_positions)
    return usual if gap > usual else max(0.5 * gap, 0.1 * usual)


EXAMPLE = Example(
    keys={"d_hat": 0.4, "stiffness": 2.0},
    in_scene={},
    zero={"exclude": [["cloth", "cloth"]]},
    idle=Idle(
        scene={"body": {"position": [0.0, 0.0, -50.0]}}, searches=True, kernels=("clothsim.contact.barrier_kernels",)
    ),
)
