"""Generated closed bodies: centred on the origin, facing outward. See `table` for what all generators share."""

from collections.abc import Sequence

import numpy as np

from clothsim.base.arrays import Floats, Ints, as_positive
from clothsim.base.errors import InputError
from clothsim.mesh.generators.argument_checks import as_count, as_counts, as_lengths
from clothsim.mesh.generators.lattice import checkerboard, cut_quads, lattice_points, lattice_quads
from clothsim.mesh.topology import half_edges


def sphere(radius: float = 0.3, subdivisions: int = 4) -> tuple[Floats, Ints]:
    """Icosphere: an icosahedron refined `subdivisions` times, 20 4^s triangles, every vertex at `radius` [m].

    >>> positions, triangles = sphere(radius=1.0, subdivisions=1)
    >>> positions.shape, triangles.shape
    ((42, 3), (80, 3))
    """
    radius, subdivisions = as_positive("radius", radius), as_count("subdivisions", subdivisions, least=0, most=8)
    positions, triangles = _icosahedron()
    for _ in range(subdivisions):
        positions, triangles = _cut_in_four(positions, triangles)
    return radius * positions, triangles


def slab(size: Sequence[float] = (1.0, 1.0, 0.1), cells: Sequence[int] = (1, 1, 1)) -> tuple[Floats, Ints]:
    """Closed box of `size` (x, y, z) [m] with `cells` (x, y, z) along its edges."""
    lengths, counts = as_lengths("size", size, 3), as_counts("cells", cells, 3)
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
    return (lattice / counts - 0.5) * lengths, renumbered.reshape(-1, 3).astype(np.int64)


def capsule(radius: float = 0.1, height: float = 0.5, segments: int = 32) -> tuple[Floats, Ints]:
    """Cylinder along z with hemispherical ends: `height` [m] from tip to tip, `segments` edges around."""
    radius, height = as_positive("radius", radius), as_positive("height", height)
    segments = as_count("segments", segments, least=4)
    straight = height - 2 * radius
    if straight <= 0:
        raise InputError(
            f"height must be above 2 radius = {2 * radius:g} m, not {height:g}.",
            'Increase the height, or use mesh = "sphere".',
        )
    ring_radius, ring_height = _capsule_rings(radius, straight, segments)
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


def cone(radius: float = 0.1, height: float = 0.3, segments: int = 32) -> tuple[Floats, Ints]:
    """Closed cone, tip up: `height` [m] over a base of `radius` [m] with `segments` edges; slender, a needle."""
    radius, height = as_positive("radius", radius), as_positive("height", height)
    n = as_count("segments", segments, least=3)
    around, following = np.arange(n), np.roll(np.arange(n), -1)
    angle = 2 * np.pi * around / n
    base = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.full(n, -height / 2)])
    middle, tip = np.full(n, n), np.full(n, n + 1)
    triangles = [np.column_stack([around, following, tip]), np.column_stack([following, around, middle])]
    return np.concatenate([base, [[0, 0, -height / 2], [0, 0, height / 2]]]), np.concatenate(triangles).astype(np.int64)


def ring(
    radius: float = 0.05, thickness: float = 0.02, segments: int = 24, around: int = 12, stretch: float = 0.0
) -> tuple[Floats, Ints]:
    """Ring about z of a round bar of `thickness` [m] along a circle of `radius` [m], pulled apart along x by `stretch`.

    `segments` edges along the ring and `around` about the bar; with a stretch [m] it is the link of a chain.

    >>> positions, triangles = ring(radius=1.0, thickness=0.5, segments=8, around=6)
    >>> positions.shape, triangles.shape
    ((48, 3), (96, 3))
    """
    radius, thickness = as_positive("radius", radius), as_positive("thickness", thickness)
    stretch = as_positive("stretch", stretch, zero=True)
    segments, around = as_count("segments", segments, least=4), as_count("around", around, least=3)
    if thickness >= 2 * radius:
        raise InputError(f"thickness must be below 2 radius = {2 * radius:g} m, not {thickness:g}.")
    along, about = (2 * np.pi * np.arange(n) / n for n in (segments, around))
    distance = (radius + 0.5 * thickness * np.cos(about))[None, :, None]
    outward = np.stack([np.cos(along), np.sin(along), np.zeros(segments)], axis=1)
    positions = distance * outward[:, None]
    positions[:, :, 2] = 0.5 * thickness * np.sin(about)
    positions[:, :, 0] += 0.5 * stretch * np.sign(np.round(outward[:, 0], 12))[:, None]
    i, j = np.meshgrid(np.arange(segments), np.arange(around), indexing="ij")
    corners = [((i + a) % segments * around + (j + b) % around).ravel() for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))]
    quads = np.stack(corners, axis=1)
    return positions.reshape(-1, 3), np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def _capsule_rings(radius: float, straight: float, segments: int) -> tuple[Floats, Floats]:
    """Radius and height of the rings from below upwards, without the tips, evenly spaced along the profile."""
    quarter = max(2, segments // 4)
    latitude = 0.5 * np.pi * np.arange(1, quarter + 1) / quarter
    across, down = radius * np.sin(latitude), straight / 2 + radius * np.cos(latitude)
    down[-1] = straight / 2
    pieces = as_count("height / radius", max(1, round(straight / (0.5 * np.pi * radius / quarter))), most=10**5)
    middle = straight * (np.arange(1, pieces) / pieces - 0.5)
    ring_radius = np.concatenate([across, np.full(pieces - 1, radius), across[::-1]])
    return ring_radius, np.concatenate([-down, middle, down[::-1]])


def _icosahedron() -> tuple[Floats, Ints]:
    golden = 0.5 * (1 + np.sqrt(5))
    corners = [(-1, golden, 0), (1, golden, 0), (-1, -golden, 0), (1, -golden, 0), (0, -1, golden), (0, 1, golden)]
    corners += [(0, -1, -golden), (0, 1, -golden), (golden, 0, -1), (golden, 0, 1), (-golden, 0, -1), (-golden, 0, 1)]
    triangles = [(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4), (11, 10, 2)]
    triangles += [(10, 7, 6), (7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9), (4, 9, 5)]
    triangles += [(2, 4, 11), (6, 2, 10), (8, 6, 7), (9, 8, 1)]
    return np.array(corners, float) / np.hypot(1, golden), np.array(triangles, np.int64)


def _cut_in_four(positions: Floats, triangles: Ints) -> tuple[Floats, Ints]:
    """Each triangle of a unit sphere cut at the midpoints of its edges, which are projected to the sphere."""
    edges, number = np.unique(np.sort(half_edges(triangles), axis=1), axis=0, return_inverse=True)
    middles = positions[edges].sum(axis=1)
    middles /= np.linalg.norm(middles, axis=1)[:, None]
    m01, m12, m20 = len(positions) + number.reshape(-1, 3).T
    a, b, c = triangles.T
    parts = [(a, m01, m20), (m01, b, m12), (m20, m12, c), (m01, m12, m20)]
    return np.concatenate([positions, middles]), np.stack([np.column_stack(part) for part in parts], axis=1).reshape(
        -1, 3
    )
