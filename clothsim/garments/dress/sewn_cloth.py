"""Cloth of a garment in sewing: its panels at rest flat, each with its fabric."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from clothsim import Cloth
from clothsim.engine import Fabric, fabric_named, fabrics_of
from clothsim.garments.dress.sewing_state import SewingState
from clothsim.patterns import Pattern


@dataclass(frozen=True)
class Fabrics:
    """Named fabric of a garment, and those of panels with one of their own, by panel (see `fabrics_of`)."""

    main: str
    of_panels: Mapping[str, str] = field(default_factory=dict)

    def of(self, pattern: Pattern) -> dict[str, Fabric]:
        """The fabric of every panel. InputError for an unknown fabric or panel."""
        main = fabric_named("fabric", self.main)
        own = fabrics_of("fabrics", list(pattern.panels), self.of_panels)
        return {panel: own.get(panel, main) for panel in pattern.panels}


def sewn_cloth(state: SewingState, fabrics: Fabrics) -> Cloth:
    """The garment at its positions as a cloth of a scene; its panels are named groups of triangles."""
    return Cloth(
        state.positions,
        state.triangles,
        rest=state.mesh.material_coordinates,
        groups={panel: np.arange(rows.start, rows.stop) for panel, rows in state.mesh.faces.items()},
        name="garment",
        fabric=fabrics.main,
        fabric_of=fabrics.of_panels or None,
        sewn=True,
    )
