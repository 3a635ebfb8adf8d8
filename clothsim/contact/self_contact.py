"""The effect `self_contact`: cloth intersects neither itself nor other cloth."""

from collections.abc import Sequence

from clothsim.contact.build import contact_energy, excluded_pairs
from clothsim.contact.surface import cloth_surface
from clothsim.energies.base import Energy, Off
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

    A pair of one and the same name in `exclude` lets that cloth pass through itself.
    """
    surface = cloth_surface(world, excluded_pairs("self_contact", world, exclude))
    if not surface.allowed.any():
        return Off("every pair is excluded")
    return contact_energy("self_contact", world, surface, d_hat, offset, stiffness, backend)
