"""Measurements of a dressed garment: girths of body and garment at the same levels, ease, areas of cloth."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.engine import Fabric, border_edges, components
from clothsim.garments.dress.level_lines import across, axis_of, ends_of, girth_along_cloth, level_line
from clothsim.garments.dress.sewing_state import SewingState
from clothsim.garments.dress.sleeves import is_of_arm
from clothsim.garments.inputs import Figure
from clothsim.patterns import Pattern

LEVELS = {"chest": np.array([0.72]), "waist": np.arange(0.58, 0.685, 0.01), "hip": np.arange(0.46, 0.555, 0.01)}
"""Levels as fractions of an adult's height: the waist has the least girth of its levels, the hip the largest (ISO
8559-1); the chest is measured at one level, as the armpits begin 3 % above."""
ASIDE = 0.16
"""Distance of the middle of a leg from the axis of the body, as a fraction of its height: arms and hands lie beyond."""
FABRIC_WIDTH, SELVEDGE = 1.4, 0.01
"""Usual width of fabric, and the distance of panels in a marker [m]."""


@dataclass(frozen=True)
class Girth:
    """Girths at one level.

    Attributes
    ----------
    name : str
        "chest", "waist", "hip" or "hem".
    level : float
        Height above the floor [m].
    body : float
        Girth of the convex hull of the body at this level, as a tape measures it [m].
    garment : float
        Length of the cloth round it, as the garment laid flat is measured [m]: the chest below the armholes, the hem
        along its border. `outline` where no level line of the pattern goes round the body there.
    outline : float
        Girth of the convex hull of the garment as worn, as a tape over its folds measures it [m].
    """

    name: str
    level: float
    body: float
    garment: float
    outline: float

    @property
    def ease(self) -> float:
        """Girth of the garment along the cloth less that of the body [m]."""
        return self.garment - self.body


def girths(state: SewingState, body: Figure) -> list[Girth]:
    """Girths at chest, waist and hip where the garment reaches, and at its hem."""
    low, high = _span(body.positions @ body.up)
    garment_low, garment_high = _span(state.positions @ body.up)
    torso = _torso_triangles(state)
    found = []
    for name, shares in LEVELS.items():
        both = [(torso_girth(body, low + share * (high - low)), low + share * (high - low)) for share in shares]
        both = [each for each in both if each[0] > 0]
        if both:
            girth, level = min(both) if name == "waist" else max(both)
            if garment_low <= level <= garment_high:
                outline = _outline(section(state.positions, torso, body.up, level)[0], body)
                along = girth_along_cloth(state, body, level, highest=name == "chest")
                found.append(Girth(name, level - low, girth, along or outline, outline))
    length, level, loop = _hem(state, body)
    around = torso_girth(body, level) or _girth_of_legs(body, level)
    return [*found, Girth("hem", level - low, around, length, _outline(state.positions[loop], body))]


def hem_of(state: SewingState, body: Figure) -> tuple[float, float]:
    """Length of the lowest border loop of the garment [m], and its mean level [m]; the ends of sleeves do not count."""
    return _hem(state, body)[:2]


def _hem(state: SewingState, body: Figure) -> tuple[float, float, Ints]:
    """Length [m], mean level [m] and vertices of the lowest border loop."""
    edges = border_edges(state.triangles)[0]
    loop = components(np.column_stack([edges, edges[:, 1]]), len(state.positions))[edges[:, 0]]
    torso = _torso_triangles(state)
    of_torso = np.isin(edges[:, 0], torso) & np.isin(edges[:, 1], torso)
    levels = (state.positions @ body.up)[edges].mean(axis=1)
    lengths = np.linalg.norm(np.diff(state.positions[edges], axis=1)[:, 0], axis=1)
    mean = {
        name: float(np.average(levels[loop == name], weights=lengths[loop == name]))
        for name in np.unique(loop)
        if of_torso[loop == name].mean() > 0.5 or not of_torso.any()
    }
    lowest = min(mean, key=lambda name: mean[name])
    return float(lengths[loop == lowest].sum()), mean[lowest], np.unique(edges[loop == lowest])


def section(positions: Floats, triangles: Ints, up: Floats, level: float) -> tuple[Floats, Ints]:
    """Cut of a mesh by a horizontal plane: points (k, 3) [m] on its edges, and the segments (s, 2) that join them."""
    edges, fractions = level_line(positions @ up, triangles, level)
    _, first, number = np.unique(edges.reshape(-1, 2), axis=0, return_index=True, return_inverse=True)
    return ends_of(edges, fractions, positions).reshape(-1, 3)[first], number.reshape(-1, 2)


def torso_girth(body: Figure, level: float) -> float:
    """Girth of the convex hull of that loop of the body's section that goes round its axis [m]; 0 without one."""
    points, label = _loops(body, level)
    axis = axis_of(body)
    hulls = [_hull(points[label == name]) for name in np.unique(label)]
    round_axis = [hull for hull in hulls if hull is not None and (hull.equations @ [*axis, 1.0] < 0).all()]
    return max((float(hull.area) for hull in round_axis), default=0.0)


def _girth_of_legs(body: Figure, level: float) -> float:
    """Girth of the convex hull of both legs [m]; 0 below the feet."""
    points, label = _loops(body, level)
    reach, axis = ASIDE * float(np.ptp(body.positions @ body.up)), axis_of(body)
    legs = [points[label == name] for name in np.unique(label)]
    legs = [leg for leg in legs if np.linalg.norm(leg.mean(axis=0) - axis) < reach]
    hull = _hull(np.concatenate(legs)) if legs else None
    return 0.0 if hull is None else float(hull.area)


def _outline(points: Floats, body: Figure) -> float:
    """Girth of the convex hull of points (k, 3) seen from above [m]; 0 without one."""
    hull = _hull(points[:, across(body)])
    return 0.0 if hull is None else float(hull.area)


def _torso_triangles(state: SewingState) -> Ints:
    """Triangles of all panels that are not of an arm, (k, 3)."""
    panels = state.mesh.pattern.panels
    rows = [state.triangles[faces] for name, faces in state.mesh.faces.items() if not is_of_arm(panels[name])]
    return np.concatenate([np.zeros((0, 3), np.int64), *rows])


def areas_of_panels(state: SewingState) -> dict[str, float]:
    """Area of cloth of each panel [m2]."""
    corners = state.mesh.material_coordinates
    edge, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    areas = (edge[:, 0] * other[:, 1] - edge[:, 1] * other[:, 0]) / 2
    return {name: float(areas[rows].sum()) for name, rows in state.mesh.faces.items()}


def measurement_entries(state: SewingState, body: Figure, fabrics: Mapping[str, Fabric]) -> dict[str, Any]:
    """Measurements as in summary.json; fabrics: of each panel."""
    areas = areas_of_panels(state)
    rows = [{**asdict(girth), "ease": girth.ease} for girth in girths(state, body)]
    total = sum(areas.values())
    width, length = marker(state.mesh.pattern)
    laid = {"width": width, "length": length, "use": total / (width * length)}
    masses = {name: fabrics[name].density * area for name, area in areas.items()}
    cut = {
        "panel_areas": areas,
        "panel_fabrics": {name: fabrics[name].name for name in areas},
        "panel_masses": masses,
        "cloth_area": total,
        "mass": sum(masses.values()),
    }
    return {"girths": rows, **cut, "marker": laid}


def marker(pattern: Pattern) -> tuple[float, float]:
    """Width and length of the fabric from which all panels are cut, warp along its length [m].

    Bounding boxes in rows, the longest panels first: an upper bound of what a marker needs.
    """
    from clothsim.render import outline

    sizes = sorted(
        (np.ptp(outline(panel), axis=0) + SELVEDGE for panel in pattern.panels.values()), key=lambda s: -s[1]
    )
    width = max(FABRIC_WIDTH, *(float(size[0]) for size in sizes))
    length, left = 0.0, 0.0
    for wide, along in sizes:
        if wide > left:  # a new row, as long as its first panel
            length, left = length + float(along), width
        left -= float(wide)
    return width, length


def _span(levels: Floats) -> tuple[float, float]:
    return float(levels.min()), float(levels.max())


def _loops(body: Figure, level: float) -> tuple[Floats, Ints]:
    """Points (k, 2) [m] of a section of the body, and the loop that each is of (k,)."""
    points, segments = section(body.positions, body.triangles, body.up, level)
    return points[:, across(body)], components(np.column_stack([segments, segments[:, 1]]), len(points))


def _hull(points: Floats) -> Any:
    """Convex hull of points (k, 2), whose `area` is its girth; None without one."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        return ConvexHull(points) if len(points) > 2 else None
    except QhullError:
        return None
