"""Generated sheets: rectangle, disk, tube and pillow. See `table` for what all generators share."""

from collections.abc import Callable, Sequence

import numpy as np

from clothsim.base.arrays import Floats, Ints, as_positive
from clothsim.base.errors import InputError
from clothsim.mesh.generators.argument_checks import as_count, as_counts, as_lengths
from clothsim.mesh.generators.lattice import checkerboard, cut_quads, lattice_points, lattice_quads

JITTER = 0.2
"""Largest shift of an interior point of a "delaunay" rectangle, in cells: irregular, without slivers."""


def rectangle(
    size: Sequence[float] = (1.0, 1.0), cells: Sequence[int] = (40, 40), diagonals: str = "alternating"
) -> tuple[Floats, Ints]:
    """Flat rectangle centred on the origin, in z = 0.

    Parameters
    ----------
    size : (x, y)
        Side lengths [m].
    cells : (x, y)
        Number of cells along each side.
    diagonals : str
        "right" (all parallel: stiffer along them), "alternating" (union jack: no preferred direction), "crisscross"
        (four triangles a cell), "delaunay" (irregular inside, evenly divided sides; the same mesh each time).

    Returns
    -------
    positions : (n, 3) float64
        [m].
    triangles : (m, 3) int64
        Facing +z.

    Examples
    --------
    >>> positions, triangles = rectangle((1.0, 0.5), (4, 2))
    >>> positions.shape, triangles.shape
    ((15, 3), (16, 3))
    """
    lengths = as_lengths("size", size, 2)
    nx, ny = as_counts("cells", cells, 2)
    if not isinstance(diagonals, str) or diagonals not in _PATTERNS:
        raise InputError(f"diagonals must be one of {', '.join(_PATTERNS)}, not {diagonals!r}.")
    points, triangles = _PATTERNS[diagonals](nx, ny)
    flat = (points / (nx, ny) - 0.5) * lengths
    return np.column_stack([flat, np.zeros(len(flat))]), triangles


def disk(radius: float = 0.5, cells: int = 20) -> tuple[Floats, Ints]:
    """Flat disk of `radius` [m] in `cells` rings; ring k has 6 k vertices, so its triangles are nearly equilateral.

    1 + 3 n (n + 1) vertices and 6 n^2 triangles; the border is the regular polygon of 6 n corners on the circle.
    """
    radius, rings = as_positive("radius", radius), as_count("cells", cells, most=1024)
    ring = np.repeat(np.arange(rings + 1), [1, *(6 * np.arange(1, rings + 1))])
    first = np.concatenate([[0], 1 + 3 * np.arange(rings) * np.arange(1, rings + 1)])
    step = np.arange(len(ring)) - first[ring]
    angle = 2 * np.pi * step / np.maximum(6 * ring, 1)
    distance = radius * ring / rings
    positions = np.column_stack([distance * np.cos(angle), distance * np.sin(angle), np.zeros(len(ring))])
    return positions, np.concatenate([_ring_triangles(k, first) for k in range(1, rings + 1)])


def tube(
    radius: float = 0.2, height: float = 0.6, cells: Sequence[int] = (48, 24), top_radius: float | None = None
) -> tuple[Floats, Ints]:
    """Open cylinder along z of `radius` and `height` [m] with `cells` (around, along), facing outward.

    top_radius [m]: radius of its upper end, where it differs (a skirt, a funnel).
    """
    radius, height = as_positive("radius", radius), as_positive("height", height)
    top = radius if top_radius is None else as_positive("top_radius", top_radius)
    around, along = as_counts("cells", cells, 2)
    as_count("cells[0]", around, least=3)
    column, row = lattice_points(around - 1, along).T
    angle = 2 * np.pi * column / around
    r = radius + (top - radius) * (row / along)
    positions = np.column_stack([r * np.cos(angle), r * np.sin(angle), height * (row / along - 0.5)])
    return positions, cut_quads(lattice_quads(around, along, closed=True), checkerboard(around, along))


def pillow(radius: float = 0.5, cells: int = 20, gap: float = 0.002) -> tuple[Floats, Ints]:
    """Two disks of `radius` [m] in `cells` rings, joined at their rim, facing outward: a closed balloon without volume.

    gap [m]: distance of the disks in the middle, falling to 0 at the rim as 1 - (r / radius)^2.
    """
    gap = as_positive("gap", gap)
    flat, triangles = disk(radius, cells)
    rim = len(flat) - 6 * cells
    lift = np.zeros_like(flat)
    lift[:rim, 2] = 0.5 * gap * (1 - (flat[:rim] ** 2).sum(axis=1) / radius**2)
    below = np.concatenate([len(flat) + np.arange(rim), np.arange(rim, len(flat))])
    return np.concatenate([flat + lift, (flat - lift)[:rim]]), np.concatenate([triangles, below[triangles[:, ::-1]]])


def _right(nx: int, ny: int) -> tuple[Floats, Ints]:
    return lattice_points(nx, ny), cut_quads(lattice_quads(nx, ny), np.zeros(nx * ny, np.int64))


def _alternating(nx: int, ny: int) -> tuple[Floats, Ints]:
    return lattice_points(nx, ny), cut_quads(lattice_quads(nx, ny), checkerboard(nx, ny))


def _crisscross(nx: int, ny: int) -> tuple[Floats, Ints]:
    corners, quads = lattice_points(nx, ny), lattice_quads(nx, ny)
    middle = len(corners) + np.arange(len(quads))
    sides = [np.column_stack([quads[:, k], quads[:, (k + 1) % 4], middle]) for k in range(4)]
    return np.concatenate([corners, corners[quads[:, 0]] + 0.5]), np.stack(sides, axis=1).reshape(-1, 3)


def _delaunay(nx: int, ny: int) -> tuple[Floats, Ints]:
    """Interior lattice points shifted at random (fixed seed), triangulated in cell units; the sides stay straight."""
    from scipy.spatial import Delaunay

    points = lattice_points(nx, ny)
    inside = ((points > 0) & (points < (nx, ny))).all(axis=1)
    points[inside] += np.random.default_rng(0).uniform(-JITTER, JITTER, (inside.sum(), 2))
    triangles = Delaunay(points).simplices.astype(np.int64)
    edge1, edge2 = points[triangles[:, 1]] - points[triangles[:, 0]], points[triangles[:, 2]] - points[triangles[:, 0]]
    area = 0.5 * (edge1[:, 0] * edge2[:, 1] - edge1[:, 1] * edge2[:, 0])
    solid = np.abs(area) > 1e-9  # Qhull may leave flat triangles between three points of one side
    triangles = np.where(area[:, None] < 0, triangles[:, [0, 2, 1]], triangles)
    return points, np.ascontiguousarray(triangles[solid])


def _ring_triangles(ring: int, first: Ints) -> Ints:
    """The 12 ring - 6 triangles between ring - 1 (at 0 the centre) and `ring`; `first`: first vertex of each ring."""
    sector = np.arange(6)[:, None]
    step = np.arange(ring)
    outer = sector * ring + step
    inner = sector * (ring - 1) + step
    inner_count = max(6 * (ring - 1), 1)

    def vertex(numbers: Ints, start: int, count: int) -> Ints:
        return (start + numbers % count).ravel()

    start_in, start_out = int(first[ring - 1]), int(first[ring])
    pointing_in = np.column_stack(
        [
            vertex(outer, start_out, 6 * ring),
            vertex(outer + 1, start_out, 6 * ring),
            vertex(inner, start_in, inner_count),
        ]
    )
    pointing_out = np.column_stack(
        [
            vertex(inner[:, :-1], start_in, inner_count),
            vertex(outer[:, 1:], start_out, 6 * ring),
            vertex(inner[:, :-1] + 1, start_in, inner_count),
        ]
    )
    return np.concatenate([pointing_in, pointing_out]).astype(np.int64)


_PATTERNS: dict[str, Callable[[int, int], tuple[Floats, Ints]]] = {
    "right": _right,
    "alternating": _alternating,
    "crisscross": _crisscross,
    "delaunay": _delaunay,
}
