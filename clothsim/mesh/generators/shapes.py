"""Generated sheets and closed bodies, centred on the origin. See `table` for what all generators share."""

from collections.abc import Callable

import numpy as np

from clothsim.base.arrays import Floats, Ints, as_count
from clothsim.base.errors import InputError
from clothsim.base.triangles import distinct_edges, half_edges
from clothsim.keys.generator_keys import Capsule, Cone, Disk, Pillow, Rectangle, Ring, Slab, Sphere, Tube
from clothsim.keys.key_table import by_keywords


def lattice_points(nx: int, ny: int) -> Floats:
    """Return the corners of nx by ny unit cells, ((nx + 1)(ny + 1), 2); the second coordinate runs fastest."""
    x, y = np.meshgrid(np.arange(nx + 1.0), np.arange(ny + 1.0), indexing="ij")
    return np.column_stack([x.ravel(), y.ravel()])


def lattice_quads(nx: int, ny: int, closed: bool = False) -> Ints:
    """Return the cells as quads (nx ny, 4), counter-clockwise from the lower left; `closed`: column nx is column 0."""
    column = np.arange(nx)[:, None]
    right = (column + 1) % nx if closed else column + 1
    row = np.arange(ny)
    corners = [column * (ny + 1) + row, right * (ny + 1) + row, right * (ny + 1) + row + 1, column * (ny + 1) + row + 1]
    return np.stack(corners, axis=2).reshape(-1, 4).astype(np.int64)


def checkerboard(nx: int, ny: int) -> Ints:
    """Return 0 or 1 for each cell in the order of `lattice_quads`, alternating along both directions, (nx ny,)."""
    return ((np.arange(nx)[:, None] + np.arange(ny)) % 2).ravel().astype(np.int64)


def cut_quads(quads: Ints, other_diagonal: Ints) -> Ints:
    """Cut each quad a b c d into two triangles, (2 k, 3): a b c and a c d, or with `other_diagonal` b c d and b d a."""
    turned = np.where(other_diagonal[:, None] == 1, np.roll(quads, -1, axis=1), quads)
    return turned[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)


JITTER = 0.2
"""Largest shift of an interior point of a "delaunay" rectangle, in cells: irregular, without slivers."""


@by_keywords(Rectangle)
def rectangle(keys: Rectangle) -> tuple[Floats, Ints]:
    """Flat rectangle centred on the origin, in z = 0.

    Diagonals: "right" (all parallel: stiffer along them), "alternating" (union jack: no preferred direction),
    "crisscross" (four triangles a cell), "delaunay" (irregular inside, evenly divided sides; the same mesh each time).

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
    points, triangles = _PATTERNS[keys.diagonals](*map(int, keys.cells))
    flat = (points / keys.cells - 0.5) * keys.size
    return np.column_stack([flat, np.zeros(len(flat))]), triangles


@by_keywords(Disk)
def disk(keys: Disk) -> tuple[Floats, Ints]:
    """Flat disk in rings; ring k has 6 k vertices, so its triangles are nearly equilateral.

    1 + 3 n (n + 1) vertices and 6 n^2 triangles; the border is the regular polygon of 6 n corners on the circle.
    """
    rings = keys.cells
    ring = np.repeat(np.arange(rings + 1), [1, *(6 * np.arange(1, rings + 1))])
    first = np.concatenate([[0], 1 + 3 * np.arange(rings) * np.arange(1, rings + 1)])
    step = np.arange(len(ring)) - first[ring]
    angle = 2 * np.pi * step / np.maximum(6 * ring, 1)
    distance = keys.radius * ring / rings
    positions = np.column_stack([distance * np.cos(angle), distance * np.sin(angle), np.zeros(len(ring))])
    return positions, np.concatenate([_ring_triangles(k, first) for k in range(1, rings + 1)])


@by_keywords(Tube)
def tube(keys: Tube) -> tuple[Floats, Ints]:
    """Open cylinder along z, or a cone where the upper end has another radius (a skirt, a funnel), facing outward."""
    around, along = map(int, keys.cells)
    as_count("tube.cells[0]", around, least=3)
    top = keys.radius if keys.top_radius is None else keys.top_radius
    column, row = lattice_points(around - 1, along).T
    angle = 2 * np.pi * column / around
    r = keys.radius + (top - keys.radius) * (row / along)
    positions = np.column_stack([r * np.cos(angle), r * np.sin(angle), keys.height * (row / along - 0.5)])
    return positions, cut_quads(lattice_quads(around, along, closed=True), checkerboard(around, along))


@by_keywords(Pillow)
def pillow(keys: Pillow) -> tuple[Floats, Ints]:
    """Two disks in rings, joined at their rim, facing outward: a closed balloon without volume.

    Their distance falls from the gap in the middle to 0 at the rim as 1 - (r / radius)^2.
    """
    flat, triangles = disk(keys.radius, keys.cells)
    rim = len(flat) - 6 * keys.cells
    lift = np.zeros_like(flat)
    lift[:rim, 2] = 0.5 * keys.gap * (1 - (flat[:rim] ** 2).sum(axis=1) / keys.radius**2)
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


@by_keywords(Sphere)
def sphere(keys: Sphere) -> tuple[Floats, Ints]:
    """Icosphere: an icosahedron refined s times, 20 4^s triangles, every vertex at the radius.

    >>> positions, triangles = sphere(radius=1.0, subdivisions=1)
    >>> positions.shape, triangles.shape
    ((42, 3), (80, 3))
    """
    golden = 0.5 * (1 + np.sqrt(5))
    corners = [(-1, golden, 0), (1, golden, 0), (-1, -golden, 0), (1, -golden, 0), (0, -1, golden), (0, 1, golden)]
    corners += [(0, -1, -golden), (0, 1, -golden), (golden, 0, -1), (golden, 0, 1), (-golden, 0, -1), (-golden, 0, 1)]
    faces = [(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4), (11, 10, 2)]
    faces += [(10, 7, 6), (7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9), (4, 9, 5)]
    faces += [(2, 4, 11), (6, 2, 10), (8, 6, 7), (9, 8, 1)]
    positions, triangles = np.array(corners, float) / np.hypot(1, golden), np.array(faces, np.int64)
    for _ in range(keys.subdivisions):  # each triangle is cut at the midpoints of its edges, projected to the sphere
        edges, number, _ = distinct_edges(half_edges(triangles))
        middles = positions[edges].sum(axis=1)
        middles /= np.linalg.norm(middles, axis=1)[:, None]
        m01, m12, m20 = len(positions) + number.reshape(-1, 3).T
        a, b, c = triangles.T
        parts = [np.column_stack(part) for part in ((a, m01, m20), (m01, b, m12), (m20, m12, c), (m01, m12, m20))]
        positions, triangles = np.concatenate([positions, middles]), np.stack(parts, axis=1).reshape(-1, 3)
    return keys.radius * positions, triangles


@by_keywords(Slab)
def slab(keys: Slab) -> tuple[Floats, Ints]:
    """Closed box in cells along its edges."""
    counts = tuple(map(int, keys.cells))
    numbers = tuple(n + 1 for n in counts)
    faces = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for side in (0, counts[axis]):
            lattice_point = np.full(((counts[u] + 1) * (counts[v] + 1), 3), side)
            lattice_point[:, [u, v]] = lattice_points(counts[u], counts[v])
            corners = np.ravel_multi_index(tuple(lattice_point.T), numbers)[lattice_quads(counts[u], counts[v])]
            triangles = cut_quads(corners, checkerboard(counts[u], counts[v]))
            faces.append(triangles if side else triangles[:, ::-1])
    used, renumbered = np.unique(np.concatenate(faces), return_inverse=True)
    lattice = np.column_stack(np.unravel_index(used, numbers))
    return (lattice / counts - 0.5) * keys.size, renumbered.reshape(-1, 3).astype(np.int64)


@by_keywords(Capsule)
def capsule(keys: Capsule) -> tuple[Floats, Ints]:
    """Cylinder along z with hemispherical ends."""
    radius, height, segments = keys.radius, keys.height, keys.segments
    straight = height - 2 * radius
    if straight <= 0:
        raise InputError(
            f"height must be above 2 radius = {2 * radius:g} m, not {height:g}.",
            'Increase the height, or use mesh = "sphere".',
        )
    # radius and height of the rings from below upwards, without the tips, evenly spaced along the profile
    quarter = max(2, segments // 4)
    latitude = 0.5 * np.pi * np.arange(1, quarter + 1) / quarter
    across, down = radius * np.sin(latitude), straight / 2 + radius * np.cos(latitude)
    down[-1] = straight / 2
    pieces = as_count("height / radius", max(1, round(straight / (0.5 * np.pi * radius / quarter))), most=10**5)
    middle = straight * (np.arange(1, pieces) / pieces - 0.5)
    ring_radius = np.concatenate([across, np.full(pieces - 1, radius), across[::-1]])
    ring_height = np.concatenate([-down, middle, down[::-1]])
    rings = len(ring_radius)
    column, row = lattice_points(segments - 1, rings - 1).astype(np.int64).T
    angle = 2 * np.pi * column / segments
    side = np.column_stack([ring_radius[row] * np.cos(angle), ring_radius[row] * np.sin(angle), ring_height[row]])
    south, north = len(side), len(side) + 1
    first = np.arange(segments) * rings
    following = np.roll(first, -1)
    triangles = [
        cut_quads(lattice_quads(segments, rings - 1, closed=True), checkerboard(segments, rings - 1)),
        np.column_stack([following, first, np.full(segments, south)]),
        np.column_stack([first + rings - 1, following + rings - 1, np.full(segments, north)]),
    ]
    return np.concatenate([side, [[0, 0, -height / 2], [0, 0, height / 2]]]), np.concatenate(triangles)


@by_keywords(Cone)
def cone(keys: Cone) -> tuple[Floats, Ints]:
    """Closed cone, tip up; slender, a needle."""
    radius, height, n = keys.radius, keys.height, keys.segments
    around, following = np.arange(n), np.roll(np.arange(n), -1)
    angle = 2 * np.pi * around / n
    base = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.full(n, -height / 2)])
    middle, tip = np.full(n, n), np.full(n, n + 1)
    triangles = [np.column_stack([around, following, tip]), np.column_stack([following, around, middle])]
    return np.concatenate([base, [[0, 0, -height / 2], [0, 0, height / 2]]]), np.concatenate(triangles).astype(np.int64)


@by_keywords(Ring)
def ring(keys: Ring) -> tuple[Floats, Ints]:
    """Ring about z of a round bar along a circle, its halves pulled apart along x: with a stretch the link of a chain.

    >>> positions, triangles = ring(radius=1.0, thickness=0.5, segments=8, around=6)
    >>> positions.shape, triangles.shape
    ((48, 3), (96, 3))
    """
    radius, thickness, segments, around = keys.radius, keys.thickness, keys.segments, keys.around
    if thickness >= 2 * radius:
        raise InputError(f"thickness must be below 2 radius = {2 * radius:g} m, not {thickness:g}.")
    along, about = (2 * np.pi * np.arange(n) / n for n in (segments, around))
    distance = (radius + 0.5 * thickness * np.cos(about))[None, :, None]
    outward = np.stack([np.cos(along), np.sin(along), np.zeros(segments)], axis=1)
    positions = distance * outward[:, None]
    positions[:, :, 2] = 0.5 * thickness * np.sin(about)
    positions[:, :, 0] += 0.5 * keys.stretch * np.sign(np.round(outward[:, 0], 12))[:, None]
    i, j = np.meshgrid(np.arange(segments), np.arange(around), indexing="ij")
    corners = [((i + a) % segments * around + (j + b) % around).ravel() for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))]
    quads = np.stack(corners, axis=1)
    return positions.reshape(-1, 3), np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
