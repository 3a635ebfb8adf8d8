"""Clearance of sleeves from the torso: sleeves that strings of the torso run through move outward along the arm.

Where the torso of a pattern is wide, its sides are placed beside the arms and its sleeves between its front and its
back. Strings of its side seams then run through the sleeves: drawn together, the torso closes round the end of each
sleeve, whose cloth then lies between both sides of the armhole.
"""

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.garments.dress.approaching import first_hits
from clothsim.garments.dress.closing_rounds import is_on_top
from clothsim.garments.dress.facing import front_of
from clothsim.garments.dress.sewing_state import SewingState
from clothsim.garments.dress.sleeves import arm_line, is_of_arm, middle_of
from clothsim.garments.inputs import Figure

SHIFTS = np.arange(0.0, 0.301, 0.01)
"""Ways along the arm that are tried [m]."""
CLEAR = 0.02
"""Further way beyond the least that frees the most strings [m]."""


def sleeves_cleared(state: SewingState, body: Figure) -> tuple[SewingState, tuple[str, ...]]:
    """State with each sleeve moved along its arm, and a note for each that was moved.

    By the least way at which the fewest strings of the torso run through its panels; sleeves that are welded to
    other panels stay.
    """
    right, middle = np.cross(body.up, front_of(body)), middle_of(body)
    strings = _strings_of_torso(state)
    positions, notes = state.positions.copy(), []
    for side in (1.0, -1.0):
        names = [
            name
            for name, panel in state.mesh.pattern.panels.items()
            if is_of_arm(panel) and side * (_rows(state, name) - middle).mean(axis=0) @ right > 0
        ]
        arm = arm_line(body, side * right, middle)
        if not names or not len(strings) or arm is None:
            continue
        faces = np.concatenate([state.triangles[state.mesh.faces[name]] for name in names])
        others = [state.triangles[rows] for name, rows in state.mesh.faces.items() if name not in names]
        if np.isin(faces, np.concatenate([np.zeros((0, 3), np.int64), *others])).any():
            continue
        through = [_through(strings - shift * arm.direction, state.positions, faces) for shift in SHIFTS]
        best = int(np.argmin(through))
        if best:
            way = SHIFTS[best] + CLEAR
            positions[np.unique(faces)] += way * arm.direction
            notes.append(
                f"{', '.join(names)} moved by {1e3 * way:.0f} mm along the arm: {through[0]} strings of the torso ran"
                f" through, {through[best]} do now"
            )
    return state.at(positions), tuple(notes)


def _rows(state: SewingState, panel: str) -> Floats:
    """Positions of the vertices of a panel, (k, 3) [m]."""
    return np.asarray(state.positions[state.number[state.mesh.vertices[panel]]], np.float64)


def _strings_of_torso(state: SewingState) -> Floats:
    """Ends of the strings of all seams between two panels of the torso, (k, 2, 3) [m]."""
    panels = state.mesh.pattern.panels
    found: list[Ints] = [np.zeros((0, 2), np.int64)]
    for k in state.open_seams:
        sides = [panels[side.panel] for side in state.mesh.seams[k].stitch.sides]
        if not any(is_of_arm(panel) or is_on_top(panel) for panel in sides):
            found.append(state.pairs(state.mesh.seams[k]))
    return np.asarray(state.positions[np.concatenate(found)], np.float64)


def _through(strings: Floats, positions: Floats, triangles: Ints) -> int:
    """Number of the segments (k, 2, 3) that meet a triangle."""
    along = strings[:, 1] - strings[:, 0]
    lengths = np.linalg.norm(along, axis=1)
    directions = along / np.maximum(lengths, np.finfo(float).tiny)[:, None]
    return int((first_hits(strings[:, 0], directions, positions, triangles) < lengths).sum())
