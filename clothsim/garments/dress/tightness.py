"""Panels that are cut too small: stretched by far throughout where the garment rests."""

import numpy as np

from clothsim.garments.dress.sewing_state import SewingState

TIGHT = 1.1
"""Larger principal stretch that half of the area of a tight panel exceeds."""
NAMED = 6
"""Panels that a note names."""


def tight_panels(state: SewingState) -> dict[str, float]:
    """Median by area of the larger principal stretch of each panel where it exceeds TIGHT, the largest first."""
    corners = state.mesh.material_coordinates
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    areas, largest = np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) / 2, state.stretches().max(axis=1)
    found = {}
    for name, rows in state.mesh.faces.items():
        order = np.argsort(largest[rows])
        summed = np.cumsum(areas[rows][order])
        found[name] = float(largest[rows][order][np.searchsorted(summed, summed[-1] / 2)])
    return {name: median for name, median in sorted(found.items(), key=lambda item: -item[1]) if median > TIGHT}


def tight_notes(state: SewingState) -> tuple[str, ...]:
    """A note with the tight panels of a garment at rest; none where there is none."""
    found = tight_panels(state)
    if not found:
        return ()
    named = ", ".join(f"{name} ({median:.2f})" for name, median in list(found.items())[:NAMED])
    more = f" and {len(found) - NAMED} more" if len(found) > NAMED else ""
    return (f"cut too small for this body, stretched over half of the panel (median stretch): {named}{more}",)
