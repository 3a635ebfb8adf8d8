"""Measurements of a dressed garment: girths of body and garment at the same levels, ease, areas of cloth."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.dressing.sewing_state import SewingState
from clothsim.fitting.inputs import Figure
from clothsim.mesh.topology import border_edges, components

LEVELS = {"chest": 0.70, "waist": 0.62, "hip": 0.52}
"""Levels as fractions of the body's height, of an adult (ISO 8559-1 measures them at the body; these are means)."""
TORSO = 0.32
"""Largest distance of the torso from the axis of the body, as a fraction of its height: arms lie beyond."""


@dataclass(frozen=True)
class Girth:
    """Girths at one level.

    Attributes
    ----------
    name : str
        "chest", "waist", "hip" or "hem".
    level : float
        Height above the floor [m].
    body, garment : float
        Girth of the convex hull of either at this level [m]; 0 where the garment is not there.
    """

    name: str
    level: float
    body: float
    garment: float

    @property
    def ease(self) -> float:
        """Girth of the garment less that of the body [m]."""
        return self.garment - self.body


def girths(state: SewingState, body: Figure) -> list[Girth]:
    """Girths at chest, waist and hip where the garment reaches, and at its hem."""
    low, high = _span(body.positions @ body.up)
    garment_low, garment_high = _span(state.positions @ body.up)
    levels = {name: low + share * (high - low) for name, share in LEVELS.items()}
    reach = TORSO / 2 * (high - low)
    found = []
    for name, level in levels.items():
        if garment_low <= level <= garment_high:
            both = [
                _hull_girth(positions, triangles, level, body, reach)
                for positions, triangles in ((body.positions, body.triangles), (state.positions, state.triangles))
            ]
            found.append(Girth(name, level - low, *both))
    hem, level = hem_of(state, body)
    return [*found, Girth("hem", level - low, _hull_girth(body.positions, body.triangles, level, body, reach), hem)]


def hem_of(state: SewingState, body: Figure) -> tuple[float, float]:
    """Length of the lowest border loop of the garment [m], and its mean level [m]."""
    edges = border_edges(state.triangles)[0]
    loop = components(np.column_stack([edges, edges[:, 1]]), len(state.positions))[edges[:, 0]]
    levels = (state.positions @ body.up)[edges].mean(axis=1)
    lengths = np.linalg.norm(np.diff(state.positions[edges], axis=1)[:, 0], axis=1)
    mean = {name: float(np.average(levels[loop == name], weights=lengths[loop == name])) for name in np.unique(loop)}
    lowest = min(mean, key=lambda name: mean[name])
    return float(lengths[loop == lowest].sum()), mean[lowest]


def section(positions: Floats, triangles: Ints, up: Floats, level: float) -> Floats:
    """Segments in which a horizontal plane cuts a mesh, (k, 2, 3) [m]."""
    heights = (positions @ up)[triangles] - level
    above = heights > 0
    cut = np.flatnonzero(above.any(axis=1) & ~above.all(axis=1))
    segments = []
    for face in cut:
        ends = []
        for a, b in ((0, 1), (1, 2), (2, 0)):
            if above[face, a] != above[face, b]:
                share = heights[face, a] / (heights[face, a] - heights[face, b])
                first, second = positions[triangles[face, a]], positions[triangles[face, b]]
                ends.append(first + share * (second - first))
        segments.append(ends)
    return np.array(segments).reshape(-1, 2, 3)


def areas_of_panels(state: SewingState) -> dict[str, float]:
    """Area of cloth of each panel [m2]."""
    corners = state.mesh.material_coordinates
    edge, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    areas = (edge[:, 0] * other[:, 1] - edge[:, 1] * other[:, 0]) / 2
    return {name: float(areas[rows].sum()) for name, rows in state.mesh.faces.items()}


def measurement_entries(state: SewingState, body: Figure) -> dict[str, Any]:
    """Measurements as in summary.json."""
    areas = areas_of_panels(state)
    rows = [{**asdict(girth), "ease": girth.ease} for girth in girths(state, body)]
    return {"girths": rows, "panel_areas": areas, "cloth_area": sum(areas.values())}


def _span(levels: Floats) -> tuple[float, float]:
    return float(levels.min()), float(levels.max())


def _hull_girth(positions: Floats, triangles: Ints, level: float, body: Figure, reach: float) -> float:
    """Girth of the convex hull of the section near the axis of the body, as a tape measures it [m]; 0 without one."""
    from scipy.spatial import ConvexHull, QhullError

    across = [k for k in range(3) if body.up[k] == 0]
    points = section(positions, triangles, body.up, level).reshape(-1, 3)[:, across]
    axis = np.array([np.ptp(body.positions[:, k]) / 2 + body.positions[:, k].min() for k in across])
    points = points[np.linalg.norm(points - axis, axis=1) < reach]
    try:
        return float(ConvexHull(points).area) if len(points) > 2 else 0.0
    except QhullError:
        return 0.0
