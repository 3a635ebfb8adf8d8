"""The effect `body_contact`: cloth and bodies never intersect."""

import numpy as np

from clothsim.arrays import as_positive
from clothsim.contact.barrier import Barrier
from clothsim.contact.candidates import Candidates
from clothsim.contact.stiffness import default_d_hat
from clothsim.contact.surface import cloth_body_surface
from clothsim.energies.base import Energy, Off
from clothsim.errors import InputError
from clothsim.mesh.world import World

SMALLEST_START = 1e-5
"""Share of d_hat below which a gap at the start is refused: collision detection would lose itself in round-off."""


def body_contact(world: World, *, d_hat: float | str = "auto", stiffness: float | str = "auto") -> Energy | Off:
    """Log-barrier contact between every cloth and every body.

    d_hat [m]: the distance at which contact begins to push, "auto": a tenth of the median cloth edge; stiffness [Pa]:
    "auto": set anew at each step from the loads. InputError names a cloth that starts inside a body.
    """
    if not world.bodies:
        return Off("the scene has no body")
    edges = world.start()[world.edges]
    lengths = np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1)
    distance = default_d_hat(lengths) if d_hat == "auto" else as_positive("effects.body_contact.d_hat", d_hat)  # type: ignore[arg-type]
    adaptive = stiffness == "auto"
    kappa = 1.0 if adaptive else as_positive("effects.body_contact.stiffness", stiffness)  # type: ignore[arg-type]
    surface = cloth_body_surface(world)
    if surface.intersects(world.start()):
        raise InputError(
            "The cloth intersects a body at the start.", "Move the cloth out of the body (position, rotation_degrees)."
        )
    candidates = Candidates(surface, distance, reach=distance)
    gap = candidates.minimum_gap(world.start())
    if gap < SMALLEST_START * distance:
        raise InputError(
            f"The cloth starts {gap:.2g} m from a body, which is contact to the last digits (d_hat is {distance:g} m).",
            "Start it further away, or choose a smaller d_hat.",
        )
    return Barrier(candidates, distance, world.vertex_areas, world.masses, kappa, adaptive)
