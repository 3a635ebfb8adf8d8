"""The guaranteed path: where no formula frees a garment of a body, the body lets it go and takes it back under IPC.

The body is deflated until the garment is clear of it, and grows back as a moving obstacle; where no depth clears it, as
between folds that lie on one another, its folds are opened first. Where that does not help either and
the garment was clear of the body that it was made for, that body becomes the other one and carries the garment along.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from clothsim.arrays import Floats, Ints
from clothsim.build.untangle import untangled
from clothsim.errors import InputError
from clothsim.fitting.deflate import deflated, half_thickness
from clothsim.fitting.penetration import counted
from clothsim.fitting.unfold_creases import unfolding
from clothsim.mesh.body import Body
from clothsim.mesh.cloth import Cloth
from clothsim.mesh.world import make_world
from transfer.errors import TransferError
from transfer.signed_distance import BodySurface, body_surface

DEPTHS = (0.0025, 0.005, 0.01, 0.02, 0.04, 0.08, 0.16)
"""How far the body's surface is moved inward [m], in the order in which they are tried."""
DEEPEST = DEPTHS[-4:-1]
"""Those that are tried once its folds are open."""


@dataclass(frozen=True)
class Clearing:
    """Bodies from the thinnest, of which a garment is clear, to the body itself; each (k, 3) [m]; said: which it is.

    One frame only: nothing had to be made thinner.
    """

    frames: tuple[Floats, ...]
    said: str = ""

    @property
    def body(self) -> Floats:
        """The thinnest."""
        return self.frames[0]


def clearings(garment: Floats, triangles: Ints, body: BodySurface) -> Iterator[Clearing]:
    """The least depth that frees `garment (n, 3)` [m] with `triangles (m, 3)` of the body, then of the body unfolded.

    The second is for a growth that fails: creases that only ever close pinch what lies in them.
    """

    def clear_of(positions: Floats) -> bool:
        try:
            surface = body_surface(positions, body.triangles)
        except TransferError:  # nothing of a volume is left
            return False
        return not surface.penetration(garment).count and counted(garment, triangles, surface).on_body

    def thinner(of: BodySurface, depths: Sequence[float]) -> tuple[float, Floats] | None:
        half = half_thickness(of)
        thin = ((depth, deflated(of, depth, half)) for depth in depths)
        return next((found for found in thin if clear_of(found[1])), None)

    if clear_of(body.positions):
        yield Clearing((body.positions,))
        return
    found = thinner(body, DEPTHS)
    if found is not None:
        yield Clearing((found[1], body.positions), f"{1e3 * found[0]:.3g} mm thinner")
    for opened in unfolding(body.positions, body.triangles):
        found = thinner(body_surface(opened, body.triangles), DEEPEST)
        if found is not None:
            said = f"without folds and {1e3 * found[0]:.3g} mm thinner"
            yield Clearing((found[1], opened, body.positions), said)
            return


def untangled_from_itself(cloth: Cloth, bodies: Sequence[Body]) -> tuple[Floats, str] | None:
    """The cloth's start (n, 3) [m] without intersections with itself and the bodies, and what was done.

    None where that fails.
    """
    try:
        freed, said = untangled(make_world([cloth], bodies))
    except InputError:
        return None
    return freed.cloths[0].positions, said
