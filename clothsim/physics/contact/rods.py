"""Contact of rods: the offset of their surface from the centre line, and what is refused.

A rod comes into contact by its centre line: its vertices against triangles and its edges against edges, in the search,
the CCD and the barrier of all others. Its surface is where the offset says: 2 r between rods, r between rod and body.
The offset is one number of an effect, so that all that takes part must be rods of one radius.
"""

from typing import TypeVar

from clothsim.base.errors import InputError
from clothsim.keys.typed_effects import ContactKeys
from clothsim.mesh.rod import Rod
from clothsim.mesh.world import World

Keys = TypeVar("Keys", bound=ContactKeys)
D_HAT = 0.1
"""Default of d_hat over the length of an edge."""


def with_offset_of_rods(world: World, keys: Keys, radii: int) -> Keys:
    """The keys of a contact with the offset of the rods of the world; unchanged where there is none.

    radii: number of radii between the centre lines, 2 of rods and 1 of a rod and a body.

    Raises
    ------
    InputError
        Where the scene has cloth or rigid bodies beside rods, rods of two radii, or edges that are shorter than the rod
        is thick: it names the rod.
    """
    if not world.rods:
        return keys
    first = world.rods[0][0]
    others = [cloth.name for cloth in world.cloths if not isinstance(cloth, Rod)]
    others += [body.name for body in world.rigid]
    if others:
        raise InputError(
            f"{keys.section}: rods ({first.name}) do not touch cloth or rigid bodies ({others[0]}) yet.",
            "Leave out the contact, or the rod; `stiffeners` are rods along edges of cloth.",
        )
    for rod, _ in world.rods:
        if rod.radius != first.radius:
            raise InputError(
                f"{keys.section}: {first.name} has a radius of {first.radius:g} m, {rod.name} of {rod.radius:g} m.",
                "Rods in contact need one radius.",
            )
        shortest = float(rod.lengths.min())
        thickness = 2 * rod.radius + (D_HAT * shortest if isinstance(keys.d_hat, str) else keys.d_hat)
        if shortest <= thickness:
            raise InputError(
                f"{rod.name} has an edge of {shortest:g} m, less than its thickness with d_hat of {thickness:g} m.",
                "Give it fewer points, or a smaller radius or d_hat.",
            )
    return keys.with_keys(offset=keys.offset + radii * first.radius)
