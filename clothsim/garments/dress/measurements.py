"""Measurements of a dressed garment: girths of body and garment at the same levels, ease, areas of cloth.

A tape round a worn garment spans its folds, and which folds there are is chosen by a micrometre; a garment laid flat,
as the trade measures it, gives the length of its cloth: that of the line that is level in the pattern as placed.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from clothsim import Pattern
from clothsim.base.arrays import Floats, Ints
from clothsim.engine import Fabric, border_edges, components
from clothsim.garments.dress.closing import is_on_top
from clothsim.garments.dress.limbs import goes_round
from clothsim.garments.dress.placement import is_of_arm
from clothsim.garments.dress.sewing_state import SewingState
from clothsim.garments.inputs import BodyMesh
from clothsim.patterns import PatternMesh

LINES = 100
"""Level lines of a garment among which the length at a level is interpolated."""


def level_line(values: Floats, triangles: Ints, level: float) -> tuple[Ints, Floats]:
    """Line along which the linear interpolant of values (n,) at the vertices equals `level`.

    Returns
    -------
    edges : (s, 2, 2) int array
        For each segment of the line the two edges of a triangle that it joins, each by its ends.
    fractions : (s, 2, 1) array
        Distance from the first end of an edge to the line, as a fraction of the edge.
    """
    above = values > level
    corners = triangles[above[triangles].any(axis=1) & ~above[triangles].all(axis=1)]
    sides = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2)  # two of three cross the level
    edges = np.sort(sides[above[sides[:, :, 0]] != above[sides[:, :, 1]]], axis=1).reshape(-1, 2, 2)
    a, b = values[edges[:, :, 0]] - level, values[edges[:, :, 1]] - level
    return edges, (a / (a - b))[:, :, None]


def ends_of(edges: Ints, fractions: Floats, positions: Floats) -> Floats:
    """Ends of the segments of a level line at positions (n, 3) [m] of the vertices, (s, 2, 3) [m]."""
    first, second = positions[edges[:, :, 0]], positions[edges[:, :, 1]]
    return np.asarray((1 - fractions) * first + fractions * second, np.float64)


def girth_along_cloth(state: SewingState, body: BodyMesh, level: float, highest: bool = False) -> float:
    """Length [m], laid flat, of the line that is level as placed and is worn at a mean height `level` [m].

    Of the panels of the torso without collars and hoods, of lines that go round the body, and of those that are closed
    unless none is, as in front of an open jacket: one through an armhole or a slanted hem is not. 0 where there is none
    at that height; with `highest` that of the highest line where all are lower, as a chest is measured below the
    armholes.
    """
    mesh = state.mesh
    panels = mesh.pattern.panels
    names = [name for name, panel in panels.items() if not is_of_arm(panel) and not is_on_top(panel)]
    if not names:
        return 0.0
    triangles = np.concatenate([mesh.triangles[mesh.faces[name]] for name in names])
    placed, worn = mesh.positions @ body.up, state.positions[state.number]
    low, high = float(placed[triangles].min()), float(placed[triangles].max())
    heights, lengths, closed, darts = [], [], [], open_darts(mesh, body.up)
    border = _edge_keys(border_edges(state.triangles)[0], len(state.positions))
    for value in low + (high - low) * (np.arange(LINES) + 0.5) / LINES:
        if ((darts[:, 0] < value) & (value < darts[:, 1])).any():
            continue
        line = level_line(placed, triangles, value)
        ends = ends_of(*line, worn)
        if goes_round(ends[:, :, across(body)] - axis_of(body)):
            flat = ends_of(*line, mesh.panel_coordinates)
            sides = np.linalg.norm(flat[:, 1] - flat[:, 0], axis=1)
            heights.append(float(np.average((ends @ body.up).mean(axis=1), weights=sides)))
            lengths.append(float(sides.sum()))
            closed.append(not np.isin(_edge_keys(state.number[line[0]], len(state.positions)), border).any())
    taken = np.array(closed, bool) if any(closed) else np.ones(len(closed), bool)
    at, long = np.array(heights)[taken], np.array(lengths)[taken]
    passing = np.flatnonzero((at[:-1] <= level) & (at[1:] >= level))
    if len(passing):  # where the lines, from below, first pass the level
        k = passing[0]
        rise = at[k + 1] - at[k]
        fraction = (level - at[k]) / rise if rise > 0 else 0.0
        return float(long[k] + fraction * (long[k + 1] - long[k]))
    return float(long[-1]) if highest and len(at) and level > at.max() else 0.0


def _edge_keys(edges: Ints, count: int) -> Ints:
    """A number for each edge (..., 2) between `count` vertices, whatever its direction."""
    return np.asarray(np.sort(edges, axis=-1) @ [count, 1], np.int64)


def open_darts(mesh: PatternMesh, up: Floats) -> Floats:
    """Lowest and highest level in the mouth of each dart that opens upward, as one at the side does, (k, 2) [m].

    There a panel has no cloth as placed, while the sewn garment has: both sides of the dart meet. What an upright dart
    takes away is missing from the garment too.
    """
    found = []
    for seam in mesh.seams:
        if len({side.panel for side in seam.stitch.sides}) == 1 and len(seam.pairs):
            apart = np.diff(mesh.positions[seam.pairs], axis=1)[:, 0]
            mouth = int(np.argmax(np.linalg.norm(apart, axis=1)))
            if abs(apart[mouth] @ up) > np.linalg.norm(apart[mouth]) / 2:
                levels = mesh.positions[seam.pairs] @ up
                found.append((float(levels.min()), float(levels.max())))
    return np.array(found).reshape(-1, 2)


def across(body: BodyMesh) -> list[int]:
    """Horizontal axes."""
    return [k for k in range(3) if body.up[k] == 0]


def axis_of(body: BodyMesh) -> Floats:
    """Vertical line through the middle of the bounding box, (2,) [m]."""
    return body.middle[across(body)]


LEVELS = {"chest": np.array([0.72]), "waist": np.arange(0.58, 0.685, 0.01), "hip": np.arange(0.46, 0.555, 0.01)}
"""Levels as fractions of an adult's height: the waist has the least girth of its levels, the hip the largest (ISO
8559-1); the chest is measured at one level, as the armpits begin 3 % above."""
ASIDE = 0.16
"""Distance of the middle of a leg from the axis of the body, as a fraction of its height: arms and hands lie beyond."""
OPEN, LEVEL = 0.5, 0.7
"""Height of a hem's loop, as a fraction of the garment's, from which on it runs along an opening; sine of the slope
of its level part."""
WAVY = 0.9
"""Height of one part of a hem between its steep edges, as a fraction of the garment's, up to which it only waves: a
frill that is half as high as the skirt has no opening."""
STEEP = 0.9
"""Sine of the slope of an edge of a panel as placed, corner to corner, from which on it is of a slit: chords of quarter
circles are at 0.71."""
FABRIC_WIDTH, SELVEDGE = 1.4, 0.01
"""Usual width of fabric, and the distance of panels in a marker [m]."""


@dataclass(frozen=True)
class LevelGirths:
    """Girths at one level.

    Attributes
    ----------
    name : str
        "chest", "waist" or "hip", where they are not below the mean level of the hem; or "hem".
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


def girths(state: SewingState, body: BodyMesh) -> list[LevelGirths]:
    """Girths at chest, waist and hip where the garment reaches, and at its hem."""
    low, high, garment_high = body.floor, body.floor + body.height, float((state.positions @ body.up).max())
    torso = _torso_triangles(state)
    length, hem, loop = _hem(state, body)
    found = []
    for name, fractions in LEVELS.items():
        heights = [low + fraction * (high - low) for fraction in fractions]
        both = [(girth, height) for height in heights if (girth := torso_girth(body, height)) > 0]
        if both:
            girth, level = min(both) if name == "waist" else max(both)
            if hem <= level <= garment_high:
                outline = _hull_girth(section(state.positions, torso, body.up, level)[0], body)
                along = girth_along_cloth(state, body, level, highest=name == "chest")
                found.append(LevelGirths(name, level - low, girth, along or outline, outline))
    around = torso_girth(body, hem) or _girth_of_legs(body, hem, state.positions[loop][:, across(body)])
    return [*found, LevelGirths("hem", hem - low, around, length, _hull_girth(state.positions[loop], body))]


def hem_of(state: SewingState, body: BodyMesh) -> tuple[float, float]:
    """Length of the lowest border loop of the garment [m], and its mean level [m]; the ends of sleeves do not count."""
    return _hem(state, body)[:2]


def _hem(state: SewingState, body: BodyMesh) -> tuple[float, float, Ints]:
    """Length [m], mean level [m] and vertices of the lowest border loop; without slits and what goes up an opening."""
    edges, half = border_edges(state.triangles)
    loop = components(np.column_stack([edges, edges[:, 1]]), len(state.positions))[edges[:, 0]]
    torso = _torso_triangles(state)
    of_torso = np.isin(edges[:, 0], torso) & np.isin(edges[:, 1], torso)
    levels = (state.positions @ body.up)[edges].mean(axis=1)
    corners = state.mesh.material_coordinates[half // 3]
    rows = np.arange(len(half))
    lengths = np.linalg.norm(corners[rows, (half + 1) % 3] - corners[rows, half % 3], axis=1)
    mean = {
        name: float(np.average(levels[loop == name], weights=lengths[loop == name]))
        for name in np.unique(loop)
        if of_torso[loop == name].mean() > 0.5 or not of_torso.any()
    }
    lowest = min(mean, key=lambda name: mean[name])
    mesh = state.mesh
    face, corner = half // 3, half % 3
    steep: list[Ints] = [np.zeros((0, 2), np.int64)]
    for rows in mesh.edges.values():
        along = mesh.positions[rows[-1]] - mesh.positions[rows[0]]
        if abs(along @ body.up) > STEEP * np.linalg.norm(along):
            steep.append(np.column_stack([rows[:-1], rows[1:]]))
    sides = np.column_stack([mesh.triangles[face, corner], mesh.triangles[face, (corner + 1) % 3]])
    keys = [np.sort(pairs, axis=1) @ [len(mesh.positions), 1] for pairs in (sides, np.concatenate(steep))]
    chosen = (loop == lowest) & ~np.isin(keys[0], keys[1])  # without slits: panel edges that are steep as placed
    chosen = chosen if chosen.any() else loop == lowest
    heights = state.positions @ body.up
    # between the steep edges of an opening lie the hem and the neck: without parts above OPEN of the garment's height
    part = components(np.column_stack([edges, edges[:, 1]])[chosen], len(heights))[edges[:, 0]]
    most = float(heights.min()) + OPEN * float(np.ptp(heights))
    low = [name for name in np.unique(part[chosen]) if heights[edges[chosen & (part == name)]].mean() < most]
    chosen = chosen & np.isin(part, low) if low else chosen

    if np.ptp(heights[edges[chosen]]) > WAVY * np.ptp(heights):  # it goes on along an opening, and round the neck
        rise = np.abs(np.diff(heights[edges], axis=1)[:, 0])
        level = chosen & (levels < heights.min() + OPEN / 2 * np.ptp(heights)) & (rise < LEVEL * lengths)
        chosen = level if level.any() else chosen  # a hem of points has no level part
    return (
        float(lengths[chosen].sum()),
        float(np.average(levels[chosen], weights=lengths[chosen])),
        np.unique(edges[chosen]),
    )


def section(positions: Floats, triangles: Ints, up: Floats, level: float) -> tuple[Floats, Ints]:
    """Cut of a mesh by a horizontal plane: points (k, 3) [m] on its edges, and the segments (s, 2) that join them."""
    edges, fractions = level_line(positions @ up, triangles, level)
    _, first, number = np.unique(edges.reshape(-1, 2), axis=0, return_index=True, return_inverse=True)
    return ends_of(edges, fractions, positions).reshape(-1, 3)[first], number.reshape(-1, 2)


def torso_girth(body: BodyMesh, level: float) -> float:
    """Girth of the convex hull of that loop of the body's section that goes round its axis [m]; 0 without one."""
    points, label = _section_loops(body, level)
    axis = axis_of(body)
    hulls = [_convex_hull(points[label == name]) for name in np.unique(label)]
    round_axis = [hull for hull in hulls if hull is not None and (hull.equations @ [*axis, 1.0] < 0).all()]
    return max((float(hull.area) for hull in round_axis), default=0.0)


def _girth_of_legs(body: BodyMesh, level: float, hem: Floats) -> float:
    """Girth of the convex hull of the legs that a hem (k, 2) [m] is round, of both where it is round none [m].

    0 below the feet.
    """
    points, label = _section_loops(body, level)
    reach, axis = ASIDE * body.height, axis_of(body)
    legs = [points[label == name] for name in np.unique(label)]
    legs = [leg for leg in legs if np.linalg.norm(leg.mean(axis=0) - axis) < reach]
    outline = _convex_hull(hem)
    if outline is not None:
        within = [leg for leg in legs if (outline.equations @ [*leg.mean(axis=0), 1.0] < 0).all()]
        legs = within or legs
    hull = _convex_hull(np.concatenate(legs)) if legs else None
    return 0.0 if hull is None else float(hull.area)


def _hull_girth(points: Floats, body: BodyMesh) -> float:
    """Girth of the convex hull of points (k, 3) seen from above [m]; 0 without one."""
    hull = _convex_hull(points[:, across(body)])
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


def measurement_entries(state: SewingState, body: BodyMesh, fabrics: Mapping[str, Fabric]) -> dict[str, Any]:
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
    sizes = sorted((np.ptp(panel.outline, axis=0) + SELVEDGE for panel in pattern.panels.values()), key=lambda s: -s[1])
    width = max(FABRIC_WIDTH, *(float(size[0]) for size in sizes))
    length, left = 0.0, 0.0
    for wide, along in sizes:
        if wide > left:  # a new row, as long as its first panel
            length, left = length + float(along), width
        left -= float(wide)
    return width, length


def _section_loops(body: BodyMesh, level: float) -> tuple[Floats, Ints]:
    """Points (k, 2) [m] of a section of the body, and the loop that each is of (k,)."""
    points, segments = section(body.positions, body.triangles, body.up, level)
    return points[:, across(body)], components(np.column_stack([segments, segments[:, 1]]), len(points))


def _convex_hull(points: Floats) -> Any:
    """Convex hull of points (k, 2), whose `area` is its girth; None without one."""
    try:
        return ConvexHull(points) if len(points) > 2 else None
    except QhullError:
        return None
