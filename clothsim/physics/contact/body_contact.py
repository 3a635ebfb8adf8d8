"""The effect `body_contact`: intersection-free contact of cloths with bodies."""

from clothsim.keys.typed_effects import BodyContact
from clothsim.mesh.world import World
from clothsim.physics.contact.setup import with_offset_of_rods
from clothsim.physics.contact.surface import cloth_body_surface, excluded_pairs
from clothsim.physics.energies.base import Energy, Off
from clothsim.physics.energies.example import Example, Idle


def body_contact(world: World, keys: BodyContact) -> Energy | Off:
    """Log-barrier contact between every cloth and every body, and of rigid bodies with bodies and each other.

    The offset is independent of the fabric's own thickness. Off where there is no body or every pair is excluded.

    Raises
    ------
    InputError
        A cloth starts in contact with a body, or d_hat does not suit the mesh.

    Examples
    --------
    >>> import clothsim
    >>> from clothsim.scene.assembly.scene_world import build
    >>> cloth, ball = {"mesh": "rectangle", "position": [0, 0, 0.5]}, {"mesh": "sphere", "radius": 0.3}
    >>> scene = clothsim.Scene(cloth=cloth, body=ball, effects={"body_contact": {"d_hat": 0.01, "offset": 0.002}})
    >>> contact = build(scene).energies["body_contact"]
    >>> contact.d_hat, contact.offset
    (0.01, 0.002)
    """
    excluded = excluded_pairs(world, keys)  # first: the intersection check reads them too
    if not world.bodies:
        return Off("the scene has no body")
    surface = cloth_body_surface(world, excluded)
    if not surface.allowed.any():
        return Off("every pair is excluded")
    from clothsim.physics.contact.setup import (
        contact_energy,  # after the last Off: no kernel is imported without a pair
    )

    return contact_energy(world, with_offset_of_rods(world, keys, 1), surface)


EXAMPLE = Example(
    keys={"d_hat": 0.5, "stiffness": 2.0},
    in_scene={},
    zero={},
    zero_scene={"body": ()},
    with_bodies=True,
    idle=Idle(
        scene={"body": {"position": [0.0, 0.0, -50.0]}},
        searches=True,
        kernels=("clothsim.physics.contact.barrier_kernels",),
    ),
)
