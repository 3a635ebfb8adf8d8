"""Lines of vertices: shortest paths along mesh edges, and stitches between two lines, matched by arc length at rest."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.mesh.topology import border_edges, components, unique_edges

STRAYING = 2.0
"""Relative lengthening of an edge one median length from the polyline: paths near it become shorter."""


def path_along(where: str, positions: Floats, edges: Ints, points: Floats) -> Ints:
    """Find the path along edges that follows a polyline.

    An edge counts longer the further its midpoint is from the polyline, so that the path stays close to it on any mesh.

    Parameters
    ----------
    where : str
        Key of the scene, for messages.
    positions : (n, 3) float64
        Vertices [m].
    edges : (e, 2) int64
        Edges that the path may use.
    points : (p, 3) float64
        Polyline [m]; each point is moved to the nearest vertex of an edge.

    Returns
    -------
    (k,) int64
        Vertices of the path, in order.

    Raises
    ------
    InputError
        Where there are fewer than two points, one is further from the mesh than an edge is long, or no path joins two.
    """
    if len(points) < 2:
        raise InputError(f"{where} has {len(points)} points.", "A line has two or more: [[x, y, z], [x, y, z]].")
    if not len(edges):
        raise InputError(f"{where}: the mesh has no such edge.")
    ends = positions[edges]
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    usual = float(np.median(lengths))
    vertices, middles = np.unique(edges), ends.mean(axis=1)
    distances = np.linalg.norm(positions[vertices] - points[:, None], axis=2)
    distant = np.flatnonzero(distances.min(axis=1) > usual)
    if distant.size:
        raise InputError(
            f"{where}[{distant[0]}] is {distances[distant[0]].min():.3g} m from the mesh at rest.",
            "Draw the line in the coordinates of the mesh before it is placed.",
        )
    stops = vertices[distances.argmin(axis=1)]
    path = stops[:1].tolist()
    for k in range(len(stops) - 1):
        along = points[k + 1] - points[k]
        squared = float(along @ along)
        fraction = np.clip((middles - points[k]) @ along / squared, 0.0, 1.0) if squared else np.zeros(len(middles))
        away = np.linalg.norm(middles - points[k] - fraction[:, None] * along, axis=1)  # from the segment
        graph = csr_array((lengths * (1 + STRAYING * (away / usual) ** 2), tuple(edges.T)), shape=(len(positions),) * 2)
        before = dijkstra(graph, directed=False, indices=stops[k], return_predecessors=True)[1]
        last, piece = int(stops[k + 1]), []
        while last != stops[k]:
            if last < 0:
                raise InputError(f"{where}: no path along the edges joins one point to the next.")
            piece.append(last)
            last = int(before[last])
        path += piece[::-1]
    return np.array(path, np.int64)


SAME = 1e-9
"""Fraction of a line below which two points on it are one."""


@dataclass(frozen=True)
class Line:
    """Line of vertices (k,), k >= 2, rows of x in order; parameters (k,): arc length at rest, from 0 to 1."""

    vertices: Ints
    parameters: Floats

    def reversed(self) -> "Line":
        """The line from its other end."""
        return Line(self.vertices[::-1], 1 - self.parameters[::-1])


def line_of(vertices: Ints, positions: Floats) -> Line:
    """Return the line through `vertices (k,)` at rest at `positions (k, 3)` [m]."""
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(positions, axis=0), axis=1))])
    return Line(vertices, lengths / (lengths[-1] or 1.0))


def stitches(first: Line, second: Line) -> tuple[Ints, Floats]:
    """Return stitches as rows (m, 3) and weights (m, 3) such that sum w x is the gap of each.

    Every vertex of the line with more vertices meets the point of the other at the same normalised arc length: a
    vertex, or a point between two. A stitch of a vertex with itself, where both lines start at the tip of a dart, is
    left out.
    """
    fine, coarse = (first, second) if len(first.vertices) >= len(second.vertices) else (second, first)
    after = np.clip(np.searchsorted(coarse.parameters, fine.parameters), 1, len(coarse.parameters) - 1)
    low, high = coarse.parameters[after - 1], coarse.parameters[after]
    fraction = np.clip((fine.parameters - low) / np.where(high > low, high - low, 1.0), 0.0, 1.0)
    fraction = np.where(np.abs(fraction - np.round(fraction)) * (high - low) < SAME, np.round(fraction), fraction)
    rows = np.column_stack([fine.vertices, coarse.vertices[after - 1], coarse.vertices[after]])
    weights = np.column_stack([np.ones(len(fraction)), fraction - 1, -fraction])
    itself = ((rows[:, 1] == rows[:, 0]) & (fraction == 0)) | ((rows[:, 2] == rows[:, 0]) & (fraction == 1))
    return rows[~itself], weights[~itself]


def nearest_stitches(vertices: Ints, rest_positions: Floats, triangles: Ints) -> tuple[Ints, Floats]:
    """Return stitches of vertices to the nearest edges, at rest, of other pieces (connected components).

    Parameters
    ----------
    vertices : (k,) int64
        Rows of x.
    rest_positions : (n, 3) float64
        All vertices at rest [m].
    triangles : (m, 3) int64
        All triangles.

    Returns
    -------
    rows : (k, 3) int64
        As of `stitches`; (0, 3) where there is one piece only.
    weights : (k, 3) float64
    """
    piece, edges = components(triangles, len(rest_positions)), unique_edges(triangles)
    rows, weights = [], []
    for vertex in vertices.tolist():
        others = edges[piece[edges[:, 0]] != piece[vertex]]
        if not len(others):
            break
        start = rest_positions[others[:, 0]]
        along = rest_positions[others[:, 1]] - start
        length = np.maximum(np.einsum("ij,ij->i", along, along), np.finfo(float).tiny)
        fraction = np.clip(np.einsum("ij,ij->i", rest_positions[vertex] - start, along) / length, 0.0, 1.0)
        best = int(np.argmin(np.linalg.norm(start + fraction[:, None] * along - rest_positions[vertex], axis=1)))
        rows.append([vertex, *others[best]])
        weights.append([1.0, fraction[best] - 1.0, -fraction[best]])
    return np.array(rows, np.int64).reshape(-1, 3), np.array(weights, np.float64).reshape(-1, 3)


def hinges_across(first: Line, second: Line, triangles: Ints) -> tuple[Ints, Ints]:
    """Return the hinges over the closed seam, where the lines are borders whose vertices match one to one; else none.

    Returns
    -------
    hinges : (h, 4) int64
        Edge and corner on the first side, corner on the second.
    pairs : (h, 2) int64
        The two triangles of each.
    """
    none = np.zeros((0, 4), np.int64), np.zeros((0, 2), np.int64)
    if len(first.vertices) != len(second.vertices) or np.abs(first.parameters - second.parameters).max() > SAME:
        return none
    edges, half = border_edges(triangles)
    at = {tuple(edge): row for row, edge in enumerate(np.sort(edges, axis=1).tolist())}
    sides = [
        np.array([at.get((min(pair), max(pair)), -1) for pair in pairwise(line.vertices.tolist())], np.int64)
        for line in (first, second)
    ]
    here, there = (side[(sides[0] >= 0) & (sides[1] >= 0)] for side in sides)
    opposite = triangles.ravel()[half // 3 * 3 + (half + 2) % 3]
    hinges = np.column_stack([edges[here], opposite[here], opposite[there]])
    return hinges, np.column_stack([half[here] // 3, half[there] // 3])
