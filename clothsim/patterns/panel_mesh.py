"""Triangulation of a panel: a hexagonal lattice inside its border, constrained Delaunay triangulation and smoothing.

Edges that are too short for the mesh are collapsed first, each with its partner in a seam: edges of a millimetre
between long ones, which pattern programs leave, would give triangles with angles below 5 degrees.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pythoncdt as cdt

from clothsim.base.arrays import Floats, Ints
from clothsim.patterns.pattern import Panel, Pattern, PatternEdge, Side, Stitch

CLEARANCE = 0.65
"""Distance of lattice points from the border, as a fraction of the spacing: nearer ones would make flat triangles."""
ROUNDS = 10
"""Rounds of smoothing; more gain less than a degree."""
SHARP, INSERTIONS = 25.0, 8
"""Angle below which a triangle of a graded panel gets its circumcentre [degrees], and bound on the rounds."""
BLOCK = 2**22
"""Largest number of point-segment pairs that are held at once."""


@dataclass(frozen=True)
class PanelMesh:
    """Triangles of a panel.

    Attributes
    ----------
    points : (n, 2) array
        Vertices [m]; the first are the samples of the border in their order.
    triangles : (m, 3) int array
        Counter-clockwise in the plane.
    """

    points: Floats
    triangles: Ints


def mesh_panel(border: Floats, spacing: float, graded: bool = False) -> PanelMesh:
    """Triangulate the inside of a closed polygon; its vertices and sides stay as they are.

    Each round of smoothing moves every inner vertex to the mean of the centroids of its triangles, weighted by their
    areas, and triangulates again.

    Parameters
    ----------
    border : (k, 2) array
        Simple polygon of either sense [m].
    spacing : float
        Distance of neighbouring inner vertices [m].
    graded : bool
        True: circumcentres of sharp triangles are inserted between a border with short sides and the lattice.

    Examples
    --------
    >>> import numpy as np
    >>> from clothsim.patterns.panel_mesh import mesh_panel
    >>> mesh = mesh_panel(np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]]), 2.0)
    >>> len(mesh.points), len(mesh.triangles)
    (4, 2)
    """
    count = len(border)
    points = np.concatenate([border, _lattice(border, spacing)])
    triangles = _constrained_delaunay(points, count)
    points, triangles = _smoothed(points, triangles, count)
    for _ in range(INSERTIONS if graded else 0):
        inserted = _circumcentres(points, triangles, border)
        if not len(inserted):
            break
        points = np.concatenate([points, inserted])
        points, triangles = _smoothed(points, _constrained_delaunay(points, count), count)
    return PanelMesh(points, triangles)


def _smoothed(points: Floats, triangles: Ints, count: int) -> tuple[Floats, Ints]:
    """Points and triangles after all rounds of smoothing; the first `count` points stay."""
    for _ in range(ROUNDS if len(points) > count else 0):
        points[count:] = _centroidal(points, triangles)[count:]
        triangles = _constrained_delaunay(points, count)
    return points, triangles


def _circumcentres(points: Floats, triangles: Ints, border: Floats) -> Floats:
    """Circumcentres of triangles with a sharp angle, apart from one another and from the border, (k, 2) [m].

    One within the circle over a side of the border would need that side divided (Ruppert 1995), which its seam
    does not allow.
    """
    corners = points[triangles]
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]  # twice
    lengths = np.sort(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2), axis=1)
    sine = area / (lengths[:, 1] * lengths[:, 2])
    square_a, square_b = (a**2).sum(axis=1), (b**2).sum(axis=1)
    offset = np.column_stack([b[:, 1] * square_a - a[:, 1] * square_b, a[:, 0] * square_b - b[:, 0] * square_a])
    centres = corners[:, 0] + offset / (2 * area)[:, None]
    radius = np.linalg.norm(offset, axis=1) / (2 * area)
    chosen: list[int] = []
    start, end = border, np.roll(border, -1, axis=0)
    for k in np.argsort(sine)[: int((sine < np.sin(np.radians(SHARP))).sum())]:
        outside = ((centres[k] - start) * (centres[k] - end)).sum(axis=1).min() > 0
        apart = all(np.linalg.norm(centres[k] - centres[j]) > max(radius[k], radius[j]) for j in chosen)
        if outside and apart and inside_and_clear(centres[k : k + 1], border, 0.0)[0]:
            chosen.append(int(k))
    return centres[chosen]


def _lattice(border: Floats, spacing: float) -> Floats:
    """Points of a hexagonal lattice inside the border and clear of it, (n, 2) [m]."""
    low, high = border.min(axis=0), border.max(axis=0)
    height = spacing * np.sqrt(3) / 2
    rows = np.arange(int((high[1] - low[1]) / height) + 2)
    columns = np.arange(-1, int((high[0] - low[0]) / spacing) + 2)
    x, y = np.meshgrid(columns * spacing, rows * height)
    x[1::2] += spacing / 2
    centred = (high - low - [0, rows[-1] * height]) / 2  # a symmetric panel has a nearly symmetric lattice
    points = np.column_stack([x.ravel() + low[0] + centred[0] % spacing, y.ravel() + low[1] + centred[1]])
    return points[inside_and_clear(points, border, CLEARANCE * spacing)]


def inside_and_clear(points: Floats, border: Floats, clearance: float) -> np.ndarray:
    """Mask (n,) of the points inside a polygon (k, 2) and further than `clearance` [m] from all of its sides."""
    found = np.zeros(len(points), bool)
    block = max(1, BLOCK // len(border))
    start, end = border, np.roll(border, -1, axis=0)
    side = end - start
    lengths = np.maximum((side**2).sum(axis=1), np.finfo(float).tiny)
    for first in range(0, len(points), block):
        offset = points[first : first + block, None, :] - start
        along = np.clip((offset * side).sum(axis=2) / lengths, 0, 1)
        squared = ((offset - along[:, :, None] * side) ** 2).sum(axis=2).min(axis=1)
        y = points[first : first + block, None, 1]
        upward, downward = (start[:, 1] <= y) & (end[:, 1] > y), (end[:, 1] <= y) & (start[:, 1] > y)
        left = side[:, 0] * offset[:, :, 1] - side[:, 1] * offset[:, :, 0]
        winding = (upward & (left > 0)).sum(axis=1) - (downward & (left < 0)).sum(axis=1)
        found[first : first + block] = (winding != 0) & (squared > clearance**2)
    return found


def _constrained_delaunay(points: Floats, count: int) -> Ints:
    """Triangles inside the closed polygon of the first `count` points, counter-clockwise (m, 3)."""
    made: Any = cdt.Triangulation(cdt.VertexInsertionOrder.AUTO, cdt.IntersectingConstraintEdges.NOT_ALLOWED, 0.0)
    made.insert_vertices(np.ascontiguousarray(points))
    rows = np.arange(count, dtype=np.uint32)
    made.insert_edges(np.ascontiguousarray(np.column_stack([rows, np.roll(rows, -1)])))
    made.erase_outer_triangles_and_holes()
    return np.asarray(made.triangles_array()["vertices"], np.int64).reshape(-1, 3)


def _centroidal(points: Floats, triangles: Ints) -> Floats:
    """Mean of the centroids of the triangles of each point, weighted by their areas, (n, 2) [m]."""
    corners = points[triangles]
    edge, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = np.repeat(edge[:, 0] * other[:, 1] - edge[:, 1] * other[:, 0], 3)
    centroids = np.repeat(corners.mean(axis=1), 3, axis=0)
    rows, n = triangles.ravel(), len(points)
    total = np.bincount(rows, weights=area, minlength=n)
    return np.column_stack([np.bincount(rows, weights=area * c, minlength=n) / total for c in centroids.T])


SHORTEST = 0.25
"""Shortest edge that stays, as a fraction of the spacing of the mesh."""
PARTNER = 0.5
"""Longest edge that is collapsed because its partner in a seam is, as a fraction of the spacing."""
SHARE = 0.05
"""Longest edge that is collapsed, as a fraction of the perimeter of its panel: a coarse mesh keeps a small panel."""
FEWEST = 3
"""Edges that a panel keeps."""


def without_slivers(pattern: Pattern, spacing: float) -> Pattern:
    """Copy of a pattern without edges shorter than a quarter of `spacing` [m]; its notes name them.

    Of a run of short edges, such as a curve given as a polyline, edges stay so that no part that is lost is longer.
    """
    partner = {side: other for stitch in pattern.stitches for side, other in (stitch.sides, stitch.sides[::-1])}
    left = {name: len(panel.edges) for name, panel in pattern.panels.items()}
    lengths = {
        Side(name, number): panel.edge_length(number)
        for name, panel in pattern.panels.items()
        for number in range(len(panel.edges))
    }
    perimeters: dict[str, float] = dict.fromkeys(pattern.panels, 0.0)
    for side, length in lengths.items():
        perimeters[side.panel] += length
    collapsed: dict[Side, float] = {}
    for side, length in lengths.items():
        group = {side, partner.get(side, side)}
        short = length < SHORTEST * spacing and max(lengths[each] for each in group) < PARTNER * spacing
        short = short and all(lengths[each] < SHARE * perimeters[each.panel] for each in group)
        spare = all(left[each.panel] - sum(g.panel == each.panel for g in group) >= FEWEST for each in group)
        if side in collapsed or not short or not spare:
            continue
        collapsed |= {each: lengths[each] for each in group}
        if any(_run(each, collapsed, len(pattern.panels[each.panel].edges)) > PARTNER * spacing for each in group):
            for each in group:
                del collapsed[each]
            continue
        for each in group:
            left[each.panel] -= 1
    if not collapsed:
        return pattern
    return _collapsed(pattern, collapsed)


def _run(side: Side, lengths: dict[Side, float], count: int) -> float:
    """Length of the run of edges in `lengths` that `side` is in, of a panel of `count` edges [m]."""
    total = lengths[side]
    for step in (1, -1):
        number = (side.edge + step) % count
        while number != side.edge and Side(side.panel, number) in lengths:
            total += lengths[Side(side.panel, number)]
            number = (number + step) % count
    return total


def _collapsed(pattern: Pattern, sides: dict[Side, float]) -> Pattern:
    numbers: dict[Side, Side] = {}
    panels = {}
    for name, panel in pattern.panels.items():
        kept = [number for number in range(len(panel.edges)) if Side(name, number) not in sides]
        numbers |= {Side(name, number): Side(name, new) for new, number in enumerate(kept)}
        panels[name] = panel if len(kept) == len(panel.edges) else _without(panel, kept)
    stitches = tuple(
        Stitch(numbers[stitch.first], numbers[stitch.second], stitch.right_wrong)
        for stitch in pattern.stitches
        if stitch.first in numbers
    )
    named = ", ".join(f"{side} ({1e3 * length:.2g} mm)" for side, length in sides.items())
    return replace(pattern, panels=panels, stitches=stitches, notes=(*pattern.notes, f"collapsed: {named}"))


def _without(panel: Panel, kept: list[int]) -> Panel:
    """Panel with the edges `kept`; the ends of each run of the others merge in the middle of them."""
    count, staying = len(panel.edges), set(kept)
    runs: list[list[int]] = []
    for number in kept:  # the loop from each kept edge to the next one
        run = [panel.edges[number].end]
        while (number := (number + 1) % count) not in staying:
            run.append(panel.edges[number].end)
        runs.append(run)
    vertices = np.array([panel.vertices[run].mean(axis=0) for run in runs])
    edges = tuple(
        PatternEdge((row - 1) % len(kept), row, panel.edges[number].curve, panel.edges[number].label)
        for row, number in enumerate(kept)
    )
    return replace(panel, vertices=vertices, edges=edges)
