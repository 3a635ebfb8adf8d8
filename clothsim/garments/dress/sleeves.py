"""Sleeves moved along the arms, away from springs of the torso.

Where the torso of a pattern is wide, its sides are placed beside the arms and its sleeves between its front and its
back. Springs of its side seams then run through the sleeves: drawn together, the torso closes round the end of each
sleeve, whose cloth then lies between both sides of the armhole. A narrow cuff that is moved past the hand closes there,
and does not come back over it.
"""

import numpy as np
from numpy.typing import NDArray

from clothsim.base.arrays import Floats, Ints
from clothsim.garments.dress.closing import is_on_top
from clothsim.garments.dress.corrections import first_hits
from clothsim.garments.dress.placement import arm_line, front_of, is_of_arm, middle_of
from clothsim.garments.dress.sewing_state import SewingState, crosses_body
from clothsim.garments.inputs import BodyMesh
from transfer.signed_distance import BodySurface

SHIFTS = np.arange(0.0, 0.301, 0.01)
"""Distances along the arm that are tried [m]."""
SHIFT_CLEAR = 0.02
"""Further distance beyond the least that frees the most springs [m]."""


def sleeves_cleared(state: SewingState, body: BodyMesh, surface: BodySurface) -> tuple[SewingState, tuple[str, ...]]:
    """State with each sleeve moved along its arm, and a note for each that was moved.

    By the least distance at which the fewest springs of the torso run through its panels, as `_best_shift` allows;
    sleeves that are welded to other panels stay.
    """
    right, middle = np.cross(body.up, front_of(body)), middle_of(body)
    springs = _torso_springs(state)
    waiting = crosses_body(springs, surface)
    positions, notes = state.positions.copy(), []
    for side in (1.0, -1.0):
        names = [
            name
            for name, panel in state.mesh.pattern.panels.items()
            if is_of_arm(panel)
            and side * (state.positions[state.number[state.mesh.vertices[name]]] - middle).mean(axis=0) @ right > 0
        ]
        arm = arm_line(body, side * right, middle)
        if not names or not len(springs) or arm is None:
            continue
        faces = np.concatenate([state.triangles[state.mesh.faces[name]] for name in names])
        others = [state.triangles[rows] for name, rows in state.mesh.faces.items() if name not in names]
        if np.isin(faces, np.concatenate([np.zeros((0, 3), np.int64), *others])).any():
            continue
        through = np.array([_crossing(springs - shift * arm.direction, state.positions, faces) for shift in SHIFTS])
        tip = float(((state.positions[np.unique(faces)] - arm.point) @ arm.direction).max())
        best = _best_shift(through, waiting, arm.reach - tip)
        if best:
            distance = SHIFTS[best] + SHIFT_CLEAR
            positions[np.unique(faces)] += distance * arm.direction
            before, after = through[[0, best]].sum(axis=1)
            notes.append(
                f"{', '.join(names)} moved by {1e3 * distance:.0f} mm along the arm: {before} springs of the torso"
                f" ran through, {after} do now"
            )
    return state.moved_to(positions), tuple(notes)


def _best_shift(through: NDArray[np.bool_], waiting: NDArray[np.bool_], room: float) -> int:
    """Number of the distance of `SHIFTS` at which the fewest springs run through a sleeve, the least of equals.

    Parameters
    ----------
    through : (s, k) bool array
        True for each spring that runs through the sleeve at each distance.
    waiting : (k,) bool array
        True for springs that run through the body: they are drawn last, when the panels lie on it.
    room : float
        Distance from the end of the sleeve to the tip of the hand [m]: it stays within, unless springs that do not wait
        ask for more.
    """
    drawn = (through & ~waiting).sum(axis=1)
    allowed = max(np.count_nonzero(room >= SHIFTS), 1)
    allowed = allowed if drawn[:allowed].min() == drawn.min() else len(SHIFTS)
    return int(np.argmin(through[:allowed].sum(axis=1)))


def _torso_springs(state: SewingState) -> Floats:
    """Ends of the springs of all seams between two panels of the torso, (k, 2, 3) [m]."""
    panels = state.mesh.pattern.panels
    found: list[Ints] = [np.zeros((0, 2), np.int64)]
    for k in state.open_seams:
        sides = [panels[side.panel] for side in state.mesh.seams[k].stitch.sides]
        if not any(is_of_arm(panel) or is_on_top(panel) for panel in sides):
            found.append(state.pairs(state.mesh.seams[k]))
    return np.asarray(state.positions[np.concatenate(found)], np.float64)


def _crossing(springs: Floats, positions: Floats, triangles: Ints) -> NDArray[np.bool_]:
    """True for each of the segments (k, 2, 3) that meets a triangle, (k,)."""
    along = springs[:, 1] - springs[:, 0]
    lengths = np.linalg.norm(along, axis=1)
    directions = along / np.maximum(lengths, np.finfo(float).tiny)[:, None]
    return np.asarray(first_hits(springs[:, 0], directions, positions, triangles) < lengths)
