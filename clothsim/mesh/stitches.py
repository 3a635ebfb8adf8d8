"""Two lines of vertices sewn together: who meets whom, matched along their lengths at rest."""

from dataclasses import dataclass

import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.mesh.topology import border_edges

SAME = 1e-9
"""Share of a line below which two places along it are one."""


@dataclass(frozen=True)
class Line:
    """vertices (k,), k >= 2, rows of x in their order along a line; places (k,): where on it at rest, from 0 to 1."""

    vertices: Ints
    places: Floats


def line_of(vertices: Ints, positions: Floats) -> Line:
    """The line through `vertices (k,)` at rest at `positions (k, 3)` [m]; they are not all at one place."""
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(positions, axis=0), axis=1))])
    return Line(vertices, lengths / lengths[-1])


def stitches(first: Line, second: Line) -> tuple[Ints, Floats]:
    """Stitches: rows (m, 3) and weights (m, 3) so that sum w x is the gap of each.

    Every vertex of the line that has more of them meets the point of the other that is at the same share of its length:
    a vertex, or one between two. A stitch of a vertex with itself, where both lines begin at the tip of a dart, is left
    out.
    """
    fine, coarse = (first, second) if len(first.vertices) >= len(second.vertices) else (second, first)
    after = np.clip(np.searchsorted(coarse.places, fine.places), 1, len(coarse.places) - 1)
    low, high = coarse.places[after - 1], coarse.places[after]
    share = np.clip((fine.places - low) / np.where(high > low, high - low, 1.0), 0.0, 1.0)
    share = np.where(np.abs(share - np.round(share)) * (high - low) < SAME, np.round(share), share)
    rows = np.column_stack([fine.vertices, coarse.vertices[after - 1], coarse.vertices[after]])
    weights = np.column_stack([np.ones(len(share)), share - 1, -share])
    itself = ((rows[:, 1] == rows[:, 0]) & (share == 0)) | ((rows[:, 2] == rows[:, 0]) & (share == 1))
    return rows[~itself], weights[~itself]


def hinges_across(first: Line, second: Line, triangles: Ints) -> tuple[Ints, Ints]:
    """The hinges over the closed seam: (h, 4) edge and corner on the first side, corner on the second; and (h, 2) the
    two triangles of each. There are some where the lines are borders whose vertices meet one to one; else none.
    """
    none = np.zeros((0, 4), np.int64), np.zeros((0, 2), np.int64)
    if len(first.vertices) != len(second.vertices) or np.abs(first.places - second.places).max() > SAME:
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
