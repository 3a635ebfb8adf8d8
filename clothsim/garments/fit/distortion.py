"""Distortion of a garment by a fit: principal stretches and displacement."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.engine import deformation_gradients, principal_stretches, triangle_planes
from clothsim.garments.fit.stage import Garment

PERCENTILES = (1.0, 99.0)


@dataclass(frozen=True)
class Cost:
    """Distortion of a fitted garment.

    Attributes
    ----------
    stretches : ndarray (m, 2)
        Principal stretches of each triangle relative to the garment as given.
    low, high : float
        Their 1st and 99th percentile.
    displacement : float
        Largest distance of a vertex from where it was worn [m] (see `worn_place`).
    """

    stretches: Floats
    low: float
    high: float
    displacement: float

    def as_dict(self) -> dict[str, Any]:
        """Entry in summary.json."""
        return {"stretch_low": self.low, "stretch_high": self.high, "displacement": self.displacement}


def cost_of(garment: Garment, positions: Floats, worn: Floats | None = None) -> Cost:
    """Distortion of the garment at `positions` (n, 3) [m]; worn (n, 3) [m]: its place on that body; None: as given."""
    planes = triangle_planes(garment.positions, garment.triangles)
    edges = np.stack([planes[:, 1] - planes[:, 0], planes[:, 2] - planes[:, 0]], axis=2)
    F = deformation_gradients(positions, garment.triangles, np.linalg.inv(edges))
    stretches = np.asarray(principal_stretches(np.asarray(F)), np.float64)
    low, high = np.percentile(stretches, PERCENTILES)
    moved = np.linalg.norm(positions - (garment.positions if worn is None else worn), axis=1)
    return Cost(stretches, float(low), float(high), float(moved.max()))
