"""The guaranteed path: where no formula frees a garment of a body, the body lets it go and takes it back under IPC.

The body is deflated until the garment is clear of it, and grows back as a moving obstacle. Where no depth clears it and
the garment was clear of the body that it was made for, that body becomes the other one and carries the garment along.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from clothsim.arrays import Floats, Ints
from clothsim.errors import InputError
from clothsim.fitting.counts import counted
from clothsim.fitting.deflate import deflated, half_thickness
from clothsim.mesh.body import Body
from clothsim.mesh.cloth import Cloth
from clothsim.mesh.world import make_world
from clothsim.scene.untangle import untangled
from transfer.distance import BodySurface, body_surface

DEPTHS = (0.0, 0.0025, 0.005, 0.01, 0.02, 0.04, 0.08, 0.16)
"""How far the body's surface is moved inward [m], in the order in which they are tried."""


@dataclass(frozen=True)
class Clearing:
    """A body `depth` [m] thinner, its vertices (k, 3) [m]: a garment is clear of it."""

    depth: float
    body: Floats


def clearing(garment: Floats, triangles: Ints, body: BodySurface) -> Clearing | None:
    """The least depth that frees `garment (n, 3)` [m] with `triangles (m, 3)` of the body; None where none does."""
    half = half_thickness(body)
    for depth in DEPTHS:
        thin = deflated(body, depth, half)
        if counted(garment, triangles, body_surface(thin, body.triangles)).on_body:
            return Clearing(depth, thin)
    return None


def untangled_from_itself(cloth: Cloth, bodies: Sequence[Body]) -> tuple[Floats, str] | None:
    """The cloth's start (n, 3) [m] without intersections with itself and the bodies, and what was done.

    None where that fails.
    """
    try:
        freed, said = untangled(make_world([cloth], bodies))
    except InputError:
        return None
    return freed.cloths[0].positions, said
