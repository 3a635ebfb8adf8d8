"""Limits of panels and meshes: lengths that no garment has, and meshes that no machine would finish."""

from typing import TYPE_CHECKING

import numpy as np

from clothsim.base.errors import InputError

if TYPE_CHECKING:
    from clothsim.patterns.pattern import Panel, Pattern

FARTHEST = 1000.0
"""Largest coordinate of a panel and largest length of an edge [m]: beyond, the unit of the file is wrong."""
MOST_VERTICES = 300_000
"""Largest number of lattice points of a pattern: some hundred times what a drape takes minutes for."""
MOST_SAMPLES = 20_000
"""Largest number of border samples of a panel."""
UNITS = "Check properties.units_in_meter, and the numbers of that panel."


def refuse_unreal(panel: "Panel") -> None:
    """InputError for coordinates, placements and edges far beyond the size of a garment, by panel and edge."""
    for what, values in (("vertex", panel.vertices), ("translation", panel.translation)):
        farthest = float(np.abs(values).max(initial=0.0))
        if not farthest <= FARTHEST:
            raise InputError(f"Panel {panel.name} has a {what} {farthest:.3g} m from the origin.", UNITS)
    for number in range(len(panel.edges)):
        with np.errstate(all="ignore"):
            length = panel.edge_length(number)
        if not length <= FARTHEST:
            raise InputError(f"Edge {number} of panel {panel.name} is {length:.3g} m long.", UNITS)


def refuse_too_fine(pattern: "Pattern", spacing: float) -> None:
    """InputError for a mesh of far too many vertices, before it is made."""
    total = 0.0
    for panel in pattern.panels.values():
        samples = sum(1 + panel.edge_length(number) / spacing for number in range(len(panel.edges)))
        if samples > MOST_SAMPLES:
            raise InputError(
                f"Panel {panel.name} would have {samples:.3g} vertices on its border at a size of {spacing:.3g} m "
                f"({len(panel.edges)} edges; at most {MOST_SAMPLES:,}).",
                "Choose a larger --size, or merge short edges.",
            )
        total += float(np.ptp(panel.vertices, axis=0).prod()) / (np.sqrt(3) / 2 * spacing**2)
    if total > MOST_VERTICES:
        least = spacing * np.sqrt(total / MOST_VERTICES)
        raise InputError(
            f"A size of {spacing:.3g} m would give about {total:.2g} vertices; at most {MOST_VERTICES:,} are meshed.",
            f"Choose a --size of {least:.2g} m or more.",
        )
