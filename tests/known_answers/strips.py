"""Strips and rings for the study of bending: cut out of a lattice at an angle, or of points at random."""

from collections.abc import Callable

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.mesh.generators.shapes import rectangle

CLOSE = 0.65
"""Points at random keep this fraction of the spacing from one another."""
TRIES = 40
"""Candidates for each point that has room."""


def lattice_strip(cells: int, degrees: float, length: float = 1.0, width: float = 0.2) -> tuple[Floats, Ints]:
    """A strip 0 <= x <= length, 0 <= y <= width cut out of a right-diagonal lattice turned by `degrees`.

    `cells` along the length; at odd multiples of 45 degrees along the diagonals of the cells, so that none is cut to a
    sliver. Returns points (n, 2) [m] and triangles (m, 3).
    """
    cell = length / cells * (1.0 if degrees % 90 == 0 else np.sqrt(2))
    reach = 2 * int(np.ceil((length + width) / cell))
    positions, triangles = rectangle((reach * cell, reach * cell), (reach, reach), "right")
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    points = positions[:, :2] @ np.array([[c, s], [-s, c]])
    for normal, offset in (((-1, 0), 0.0), ((1, 0), length), ((0, -1), 0.0), ((0, 1), width)):
        points, triangles = cut(points, triangles, np.array(normal, float), offset)
    return points, triangles


def random_strip(cells: int, seed: int, length: float = 1.0, width: float = 0.2) -> tuple[Floats, Ints]:
    """Strip with an evenly divided border and random points inside, Delaunay."""
    h = length / cells
    across = max(1, round(width / h))
    x, y = np.linspace(0, length, cells + 1), np.linspace(0, width, across + 1)
    sides = [np.column_stack([x, 0 * x + end]) for end in (0.0, width)]
    ends = [np.column_stack([0 * y + end, y])[1:-1] for end in (0.0, length)]
    room = length * width / h**2

    def candidates(rng: np.random.Generator) -> Floats:
        return rng.uniform([0.4 * h, 0.4 * h], [length - 0.4 * h, width - 0.4 * h], (int(TRIES * room), 2))

    return _delaunay(_thinned(np.concatenate([*sides, *ends]), candidates, h, seed))


def random_ring(cells: int, seed: int, inner: float, outer: float) -> tuple[Floats, Ints]:
    """The ring between two circles about the origin, points at random inside, `cells` across."""
    h = (outer - inner) / cells

    def circle(radius: float) -> Floats:
        count = int(np.ceil(2 * np.pi * radius / h))
        turn = 2 * np.pi * np.arange(count) / count
        return radius * np.column_stack([np.cos(turn), np.sin(turn)])

    def candidates(rng: np.random.Generator) -> Floats:
        count = int(TRIES * np.pi * (outer**2 - inner**2) / h**2)
        radius = np.sqrt(rng.uniform((inner + 0.45 * h) ** 2, (outer - 0.45 * h) ** 2, count))
        turn = rng.uniform(0, 2 * np.pi, count)
        return radius[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])

    border = circle(inner)
    points, triangles = _delaunay(_thinned(np.concatenate([border, circle(outer)]), candidates, h, seed))
    return points, triangles[(triangles >= len(border)).any(axis=1)]


def cut(points: Floats, triangles: Ints, normal: Floats, offset: float) -> tuple[Floats, Ints]:
    """The part of a flat mesh with normal.x <= offset; edges across the line get a vertex on it."""
    height = points @ normal - offset
    height[np.abs(height) < 1e-9 * np.abs(height).max()] = 0.0
    crossings: dict[tuple[int, int], int] = {}
    kept: list[tuple[int, int, int]] = []
    placed = list(points)
    for triangle in triangles[(height[triangles] < 0).any(axis=1)].tolist():
        corners = []
        for a, b in zip(triangle, triangle[1:] + triangle[:1], strict=True):
            if height[a] <= 0:
                corners.append(a)
            if height[a] * height[b] < 0:
                low, high = min(a, b), max(a, b)
                if (low, high) not in crossings:
                    crossings[low, high] = len(placed)
                    fraction = height[low] / (height[low] - height[high])
                    placed.append(points[low] + fraction * (points[high] - points[low]))
                corners.append(crossings[low, high])
        kept.extend((corners[0], corners[k], corners[k + 1]) for k in range(1, len(corners) - 1))
    used, numbered = np.unique(np.array(kept), return_inverse=True)
    return np.array(placed)[used], numbered.reshape(-1, 3).astype(np.int64)


def _thinned(border: Floats, candidates: Callable[[np.random.Generator], Floats], h: float, seed: int) -> Floats:
    """The border and, one after the other, the candidates that have room beside those before."""
    offered = candidates(np.random.default_rng(seed))
    points = np.concatenate([border, np.empty_like(offered)])
    count = len(border)
    for point in offered:
        if ((points[:count] - point) ** 2).sum(axis=1).min() > (CLOSE * h) ** 2:
            points[count] = point
            count += 1
    return points[:count]


def _delaunay(points: Floats) -> tuple[Floats, Ints]:
    from scipy.spatial import Delaunay

    triangles = Delaunay(points).simplices.astype(np.int64)
    a, b, c = (points[triangles[:, k]] for k in range(3))
    area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    triangles = np.where(area[:, None] < 0, triangles[:, [0, 2, 1]], triangles)
    return points, np.ascontiguousarray(triangles[np.abs(area) > 1e-9 * np.abs(area).max()])
