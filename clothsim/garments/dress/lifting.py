"""Lift of the torso of a garment: strings of its seams that would run through the body are raised above the shoulders.

Panels are often placed so low that the straight line between both sides of a shoulder seam runs through the shoulder:
drawn together there, the garment slips down over the arms.
"""

import numpy as np

from clothsim.garments.dress.closing_rounds import WITHIN, order_of
from clothsim.garments.dress.sewing_state import SewingState
from clothsim.garments.dress.sleeves import is_of_arm
from clothsim.garments.dress.strings import strings_through
from clothsim.garments.inputs import Figure
from transfer.signed_distance import BodySurface

LIFTS = np.arange(0.0, 0.151, 0.01)
"""Lifts that are tried [m]."""
CLEAR = 0.01
"""Further lift above the least that frees the most strings [m]."""


def lifted(state: SewingState, body: Figure, surface: BodySurface) -> tuple[SewingState, str]:
    """State with the torso lifted by the least height at which the fewest strings run through the body; and a note."""
    pairs = [
        state.pairs(state.mesh.seams[k])
        for k in state.open_seams
        if order_of(state.mesh.seams[k], state) == WITHIN and not _of_arm(state, k)
    ]
    rows = np.unique(np.concatenate([np.zeros(0, np.int64), *(_torso(state))]))
    if not pairs or not len(rows):
        return state, ""
    joined = np.concatenate(pairs)
    through = [strings_through(state.positions[joined] + lift * body.up, surface) for lift in LIFTS]
    best = int(np.argmin(through))
    if best == 0:
        return state, ""
    positions = state.positions.copy()
    height = LIFTS[best] + CLEAR
    positions[rows] += height * body.up
    note = f"the torso was lifted by {1e3 * height:.0f} mm: {through[0]} strings of its seams ran through the body"
    return state.at(positions), f"{note}, {through[best]} do now"


def _of_arm(state: SewingState, seam: int) -> bool:
    return any(is_of_arm(state.mesh.pattern.panels[side.panel]) for side in state.mesh.seams[seam].stitch.sides)


def _torso(state: SewingState) -> list[np.ndarray]:
    """Vertices of each panel that is not of an arm."""
    panels = state.mesh.pattern.panels.values()
    return [state.number[state.mesh.vertices[panel.name]] for panel in panels if not is_of_arm(panel)]
