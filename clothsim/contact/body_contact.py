"""The effect `body_contact`: cloth and bodies never intersect."""

from collections.abc import Sequence

from clothsim.contact.setup import contact_energy, excluded_pairs
from clothsim.contact.surface import cloth_body_surface
from clothsim.energies.base import Energy, Off
from clothsim.energies.example import Example, Idle
from clothsim.mesh.world import World


def body_contact(
    world: World,
    *,
    d_hat: float | str = "auto",
    offset: float = 0.0,
    stiffness: float | str = "auto",
    exclude: Sequence[Sequence[str]] = (),
    backend: str = "auto",
) -> Energy | Off:
    """Log-barrier contact between every cloth and every body.

    d_hat [m]: the distance at which contact begins to push, "auto": a tenth of the median cloth edge; offset [m]: the
    distance that is kept free beside it (a thickness of contact, apart from the fabric's own); stiffness [Pa]: "auto":
    set anew at each step from the loads; exclude: pairs of names that do not touch. InputError names a cloth that
    starts in contact with a body.
    """
    if not world.bodies:
        return Off("the scene has no body")
    surface = cloth_body_surface(world, excluded_pairs("body_contact", world, exclude))
    if not surface.allowed.any():
        return Off("every pair is excluded")
    return contact_energy("body_contact", world, surface, d_hat, offset, stiffness, backend)


EXAMPLE = Example(
    keys={"d_hat": 0.5, "stiffness": 2.0},
    in_scene={},
    zero={},
    zero_scene={"body": ()},
    with_bodies=True,
    idle=Idle(
        scene={"body": {"position": [0.0, 0.0, -50.0]}}, searches=True, kernels=("clothsim.contact.barrier_kernels",)
    ),
)
