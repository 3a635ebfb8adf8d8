"""Stitches between two lines of vertices, matched by arc length at rest."""

from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.mesh.topology import border_edges, components, unique_edges

SAME = 1e-9
"""Fraction of a line below which two points on it are one."""


@dataclass(frozen=True)
class Line:
    """Line of vertices (k,), k >= 2, rows of x in order; parameters (k,): arc length at rest, from 0 to 1."""

    vertices: Ints
    parameters: Floats


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
        np.array([at.get(tuple(pair), -1) for pair in np.sort(_pairs(line.vertices), axis=1).tolist()], np.int64)
        for line in (first, second)
    ]
    here, there = (side[(sides[0] >= 0) & (sides[1] >= 0)] for side in sides)
    opposite = triangles.ravel()[half // 3 * 3 + (half + 2) % 3]
    hinges = np.column_stack([edges[here], opposite[here], opposite[there]])
    return hinges, np.column_stack([half[here] // 3, half[there] // 3])


def _pairs(vertices: Ints) -> Ints:
    return np.column_stack([vertices[:-1], vertices[1:]])
