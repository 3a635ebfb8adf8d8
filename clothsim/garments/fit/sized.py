"""Size of a transferred garment: as it was cut, or graded by the girths and lengths of the two bodies."""

from dataclasses import dataclass, field

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.garments.fit.stage import Garment
from clothsim.garments.inputs import Figure
from clothsim.garments.waistband import with_waistbands
from transfer.errors import TransferError
from transfer.signed_distance import BodySurface


@dataclass(frozen=True)
class Size:
    """Size of a garment on the target: positions (n, 3) [m]; kind "graded", "own" or "transferred"; its factors.

    rest (n, 3) [m]: its rest shape, with waistbands closed where it is graded; else `positions`.
    "transferred": one of the figures is no standing body; the garment has the shape that the transfer gave it.
    """

    positions: Floats
    kind: str
    rest: Floats
    factors: dict[str, float] = field(default_factory=dict)

    def as_dict(self) -> dict[str, object]:
        """Entry in summary.json."""
        return {"kind": self.kind, "factors": self.factors}

    def __str__(self) -> str:
        if self.kind == "own":
            return "as it was cut"
        return ", ".join(f"{name.replace('_', ' ')} {value:.2f}" for name, value in self.factors.items())


def sized(garment: Garment, source: Figure, target: Figure, positions: Floats, body: BodySurface, graded: bool) -> Size:
    """The garment near `positions` (n, 3) [m] on the target, `body`, with its own or with graded lengths."""
    from transfer.keep_lengths import with_lengths
    from transfer.size_factors import graded_metric, size_factors

    try:
        parts = [figure.parts for figure in (source, target)]
    except TransferError:
        return Size(positions, "transferred", positions)
    triangles, given = garment.triangles, garment.positions
    factors = size_factors(*parts)
    middles = given[triangles].mean(axis=1)
    own = np.broadcast_to(np.eye(3), (len(triangles), 3, 3))
    metric = graded_metric(factors, parts[0], source.positions, middles) if graded else own
    shape = with_lengths(positions, triangles, given, metric, body, parts[1].frame.height)
    if not graded:
        return Size(shape, "own", shape)
    banded = with_waistbands(shape, triangles, target, parts[1])
    named = factors.named | ({"waistband": min(banded.factors)} if banded.factors else {})
    return Size(shape, "graded", banded.rest, named)
