"""Level lines of a function on a mesh, and the length of the cloth round a body along one of them.

A tape round a worn garment spans its folds, and which folds there are is chosen by a micrometre; a garment laid flat,
as the trade measures it, gives the length of its cloth: that of the line that is level in the pattern as placed.
"""

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.garments.dress.closing_rounds import is_on_top
from clothsim.garments.dress.sewing_state import SewingState
from clothsim.garments.dress.sleeves import is_of_arm
from clothsim.garments.inputs import Figure

SECTORS = 24
"""Directions from the axis of the body in all of which a line round it lies."""
LEVELS = 100
"""Level lines of a garment among which the length at a level is interpolated."""


def level_line(values: Floats, triangles: Ints, level: float) -> tuple[Ints, Floats]:
    """Line along which the linear interpolant of values (n,) at the vertices equals `level`.

    Returns
    -------
    edges : (s, 2, 2) int array
        For each segment of the line the two edges of a triangle that it joins, each by its ends.
    fractions : (s, 2, 1) array
        Way from the first end of an edge to the line, as a fraction of the edge.
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


def girth_along_cloth(state: SewingState, body: Figure, level: float, highest: bool = False) -> float:
    """Length [m], as worn, of the line that is level in the pattern as placed and is worn at a mean height `level` [m].

    Of the panels of the torso without collars and hoods, of lines that go round the body: one through an armhole or a
    slanted hem does not. 0 where there is none at that height; with `highest` that of the highest line where all are
    lower, as a chest is measured below the armholes.
    """
    mesh = state.mesh
    panels = mesh.pattern.panels
    names = [name for name, panel in panels.items() if not is_of_arm(panel) and not is_on_top(panel)]
    if not names:
        return 0.0
    triangles = np.concatenate([mesh.triangles[mesh.faces[name]] for name in names])
    placed, worn = mesh.positions @ body.up, state.positions[state.number]
    low, high = float(placed[triangles].min()), float(placed[triangles].max())
    heights, lengths = [], []
    for value in low + (high - low) * (np.arange(LEVELS) + 0.5) / LEVELS:
        ends = ends_of(*level_line(placed, triangles, value), worn)
        if goes_round(ends[:, :, across(body)] - axis_of(body)):
            sides = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
            heights.append(float(np.average((ends @ body.up).mean(axis=1), weights=sides)))
            lengths.append(float(sides.sum()))
    return _at(np.array(heights), np.array(lengths), level, highest)


def goes_round(segments: Floats) -> bool:
    """True where segments (s, 2, 2) lie in every direction from the origin, in sectors of 360 / SECTORS degrees."""
    points = segments[:, :1] + np.linspace(0, 1, 4)[:, None] * (segments[:, 1:] - segments[:, :1])
    angle = np.arctan2(points[..., 1], points[..., 0]).ravel()
    return len(np.unique(np.floor(angle / (2 * np.pi) * SECTORS).astype(np.int64) % SECTORS)) == SECTORS


def across(body: Figure) -> list[int]:
    """Horizontal axes."""
    return [k for k in range(3) if body.up[k] == 0]


def axis_of(body: Figure) -> Floats:
    """Vertical line through the middle of the bounding box, (2,) [m]."""
    flat = body.positions[:, across(body)]
    return np.asarray((flat.min(axis=0) + flat.max(axis=0)) / 2, np.float64)


def _at(heights: Floats, lengths: Floats, level: float, highest: bool) -> float:
    """Length at a level where the heights of the lines, from below, first pass it."""
    passing = np.flatnonzero((heights[:-1] <= level) & (heights[1:] >= level))
    if len(passing):
        k = passing[0]
        rise = heights[k + 1] - heights[k]
        share = (level - heights[k]) / rise if rise > 0 else 0.0
        return float(lengths[k] + share * (lengths[k + 1] - lengths[k]))
    return float(lengths[-1]) if highest and len(heights) and level > heights.max() else 0.0
