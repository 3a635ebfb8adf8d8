"""Separation of placed panels that intersect one another or the body."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from clothsim.base.arrays import Floats
from clothsim.engine import intersecting_pairs
from clothsim.garments.dress.sewing_state import SewingState
from clothsim.garments.inputs import Figure
from clothsim.garments.penetration import penetrations
from transfer.signed_distance import BodySurface

STEP = 0.005
"""Displacement of a panel in each round [m]."""
ROUNDS = 24
"""Bound on the rounds."""
MARGIN = 0.004
"""Further displacement of all panels that were moved [m]: contact begins at a distance."""


def separated(state: SewingState, body: Figure, surface: BodySurface) -> tuple[SewingState, str]:
    """State whose panels are moved rigidly, away from the body's axis, until none intersects; and a description.

    In each round the panels with an intersection move outward: along the normal of their plane, to the side that is
    farther from the vertical axis of the body. Of two panels that intersect each other the outer one moves, so that
    panels placed in one plane are stacked.
    """
    of_panel = rigid_groups(state)
    outward = outward_of_groups(state, body)
    shift = np.zeros(len(outward))
    positions = state.positions
    for _ in range(ROUNDS):
        counts, with_body, own = penetrations(positions, state.triangles, surface)
        if counts.clean:
            break
        moving = _moving(state, positions, with_body, own, surface, of_panel, shift)
        shift[moving] += STEP
        positions = state.positions + (shift[:, None] * outward)[of_panel]
    if shift.any():
        extended = state.positions + ((shift + MARGIN * (shift > 0))[:, None] * outward)[of_panel]
        if penetrations(extended, state.triangles, surface)[0].clean:
            positions = extended
    text = ", ".join(name for name, moved in zip(_names(state, of_panel), shift, strict=True) if moved > 0)
    return state.at(positions), f"moved outward by at most {1e3 * shift.max():.3g} mm: {text}"


def panels_in_contact(state: SewingState, surface: BodySurface) -> list[str]:
    """Names of the panels that intersect the body, and of those that intersect another one."""
    _, with_body, _ = penetrations(state.positions, state.triangles, surface)
    starts = np.array([rows.start for rows in state.mesh.faces.values()])
    names = list(state.mesh.faces)
    hit = {names[k] for k in np.searchsorted(starts, with_body[:, 0], side="right") - 1}
    return sorted(hit | crossing_panels(state), key=names.index)


def crossing_panels(state: SewingState) -> set[str]:
    """Names of the panels that intersect another one."""
    pairs = intersecting_pairs(state.positions, state.triangles)
    starts = np.array([rows.start for rows in state.mesh.faces.values()])
    panels = np.searchsorted(starts, pairs, side="right") - 1
    names = list(state.mesh.faces)
    return {names[k] for k in np.unique(panels[panels[:, 0] != panels[:, 1]])}


def _names(state: SewingState, of_panel: np.ndarray) -> list[str]:
    """Name of the first panel of each group."""
    found: dict[int, str] = {}
    for name, rows in state.mesh.vertices.items():
        found.setdefault(int(of_panel[state.number[rows.start]]), name)
    return [found[group] for group in range(len(found))]


def rigid_groups(state: SewingState) -> np.ndarray:
    """Group of panels joined by welds of each vertex of the garment, (k,)."""
    faces = state.triangles
    n = len(state.positions)
    links = np.concatenate([faces[:, :2], faces[:, 1:]])
    graph = coo_array((np.ones(len(links)), (links[:, 0], links[:, 1])), shape=(n, n))
    return np.asarray(connected_components(graph, directed=False)[1])


def outward_of_groups(state: SewingState, body: Figure) -> Floats:
    """Unit normal of each group, horizontal where it can be, on the side away from the body's axis, (g, 3)."""
    label = rigid_groups(state)
    middle = (body.positions.max(axis=0) + body.positions.min(axis=0)) / 2
    found = []
    for group in range(label.max() + 1):
        faces = state.triangles[label[state.triangles[:, 0]] == group]
        corners = state.positions[faces]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]).sum(axis=0)
        flat = normal - (normal @ body.up) * body.up
        normal = flat if np.linalg.norm(flat) > 0.3 * np.linalg.norm(normal) else normal
        normal = normal / np.linalg.norm(normal)
        away = corners.mean(axis=(0, 1)) - middle
        found.append(normal if normal @ away >= 0 else -normal)
    return np.array(found)


def _moving(
    state: SewingState,
    positions: Floats,
    with_body: np.ndarray,
    own: np.ndarray,
    surface: BodySurface,
    of_panel: np.ndarray,
    shift: Floats,
) -> list[int]:
    """Groups that move in this round."""
    faces = state.triangles
    moving = {int(group) for group in of_panel[faces[with_body[:, 0], 0]]}
    moving |= {int(group) for group in of_panel[surface.closest(positions).signed_distance < 0]}
    for a, b in {tuple(sorted(pair)) for pair in of_panel[faces[own][:, :, 0]].tolist()}:
        if a != b and not {a, b} & moving:
            moving.add(b if shift[b] >= shift[a] else a)
    return sorted(moving)
