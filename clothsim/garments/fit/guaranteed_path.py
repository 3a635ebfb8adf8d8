"""Guaranteed path: deflation of the body until the garment is clear, then inflation under IPC.

The body is deflated until the garment is clear of it, and grows back as a moving obstacle; where no depth clears it, as
between folds in contact, its folds are opened first. Where that does not help either and the garment
was clear of the body that it was made for, that body is morphed into the other one under the garment.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.engine import intersecting_pairs
from clothsim.garments.fit.deflate import deflated, half_thickness, outward_normals
from clothsim.garments.fit.unfold_creases import unfolding
from transfer.errors import TransferError
from transfer.signed_distance import BodySurface, body_surface

DEPTHS = (0.0025, 0.005, 0.01, 0.02, 0.04, 0.08, 0.16)
"""Deflation depths [m], in the order in which they are tried."""
DEEPEST = DEPTHS[-4:-1]
"""Depths tried once the folds are open [m]."""


@dataclass(frozen=True)
class Clearing:
    """Body frames from the thinnest, which a garment is clear of, to the body itself; each (k, 3) [m].

    description: deflation in words; a single frame means that no deflation was needed.
    """

    frames: tuple[Floats, ...]
    description: str = ""

    @property
    def body(self) -> Floats:
        """Thinnest frame, (k, 3) [m]."""
        return self.frames[0]


def clearings(garment: Floats, triangles: Ints, body: BodySurface) -> Iterator[Clearing]:
    """Clearings by the least depth that frees `garment` (n, 3) [m] of the body, then of the body unfolded.

    The second serves where inflation fails: creases that close pinch the cloth in them.
    """

    def clear_of(positions: Floats) -> bool:
        together = np.concatenate([garment, positions])
        if len(intersecting_pairs(together, triangles, body.triangles + len(garment), limit=1)):
            return False  # found in a tenth of the time that preparing the body takes
        try:
            surface = body_surface(positions, body.triangles)
        except TransferError:  # the deflated body has no volume
            return False
        return not surface.penetration(garment).count

    def thinner(of: BodySurface, depths: Sequence[float]) -> tuple[float, Floats] | None:
        half, normals = half_thickness(of), outward_normals(of)
        thin = ((depth, deflated(of, depth, half, normals)) for depth in depths)
        return next((thinned for thinned in thin if clear_of(thinned[1])), None)

    if clear_of(body.positions):
        yield Clearing((body.positions,))
        return
    thinned = thinner(body, DEPTHS)
    if thinned is not None:
        yield Clearing((thinned[1], body.positions), f"{1e3 * thinned[0]:.3g} mm thinner")
    for opened in unfolding(body.positions, body.triangles):
        thinned = thinner(body_surface(opened, body.triangles), DEEPEST)
        if thinned is not None:
            description = f"without folds and {1e3 * thinned[0]:.3g} mm thinner"
            yield Clearing((thinned[1], opened, body.positions), description)
            return
