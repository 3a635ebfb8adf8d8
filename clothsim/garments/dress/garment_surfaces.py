"""Garment in sewing as a surface to draw: cloth with its seams as dark lines."""

from collections import Counter
from collections.abc import Mapping

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.engine import Fabric
from clothsim.garments.dress.sewing_state import SewingState
from clothsim.garments.inputs import Figure
from clothsim.render import WIDTHS, Surface, vertex_normals

LINE = 0.003
"""Width of the line of a seam [m]."""
POINT = 1e-6
"""Length of the second stroke of a cross, which only says in which plane the first one lies [m]."""


def garment_surface(
    state: SewingState, positions: Floats, stretches: Floats | None = None, fabrics: Mapping[str, Fabric] | None = None
) -> Surface:
    """Cloth at positions (k, 3) [m] with its sewn edges; stretches (m, 2) colour it, None: plain by fabric of panel."""
    plain = np.zeros((0, 2)) if stretches is None else stretches
    spacing = LINE / WIDTHS[0]
    return Surface(
        "garment",
        positions,
        state.triangles,
        "cloth",
        plain,
        strokes=seam_strokes(state, positions),
        spacing=spacing,
        fabrics=numbers_of_fabrics(state, fabrics or {}),
    )


def numbers_of_fabrics(state: SewingState, fabrics: Mapping[str, Fabric]) -> Ints:
    """Number of the fabric of each triangle, (m,), the one of most panels first; fabrics: of each panel."""
    order = [name for name, _ in Counter(fabric.name for fabric in fabrics.values()).most_common()]
    numbers = np.zeros(len(state.triangles), np.int64)
    for panel, fabric in fabrics.items():
        numbers[state.mesh.faces[panel]] = order.index(fabric.name)
    return numbers


def body_surface_look(body: Figure) -> Surface:
    """The body."""
    return Surface(body.name, body.positions, body.triangles, "body", np.zeros((0, 2)))


def seam_strokes(state: SewingState, positions: Floats) -> Floats:
    """Sides of all sewn edges as strokes along them, (k, 2, 2, 3) [m]."""
    lines = [state.number[state.mesh.edges[side]] for seam in state.mesh.seams for side in seam.stitch.sides]
    pairs = np.concatenate([np.zeros((0, 2), np.int64), *(np.column_stack([rows[:-1], rows[1:]]) for rows in lines)])
    pairs = np.unique(np.sort(pairs, axis=1), axis=0)
    ends = positions[pairs]
    normal = vertex_normals(positions, state.triangles)[pairs].sum(axis=1)
    across = np.cross(normal, ends[:, 1] - ends[:, 0])
    across *= POINT / np.maximum(np.linalg.norm(across, axis=1), np.finfo(float).tiny)[:, None]
    middle = ends.mean(axis=1)
    return np.stack([ends, np.stack([middle - across, middle + across], axis=1)], axis=1)
