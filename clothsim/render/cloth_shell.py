"""Cloth with a thickness: both faces, rims along the borders, hems and their stitches.

A simulated cloth is a surface without thickness. What makes a drawn one look like cloth are its cut edges: a rim as
wide as the cloth is thick, a hem of two layers behind it and a row of stitches that holds the hem.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial import cKDTree

from clothsim.base.arrays import Floats, Ints
from clothsim.base.linalg import unit
from clothsim.render.surface_look import Surface, vertex_normals

THICKNESS, HEM_LAYERS = 1.0e-3, 2.2
"""Thickness that is drawn [m], and the factor on it in a hem. Contact keeps layers about as far apart."""
HEM_WIDTH, HEM_SLOPE = 0.018, 0.0015
"""Width of a hem, and of the step at its end [m]."""
STITCH, GAP, THREAD = 0.0034, 0.0014, 0.0003
"""Length of a stitch, the gap behind it, and the radius of its thread [m]."""
WIDEST_HEM = 0.06
"""Largest hem relative to the size of the cloth: a card has none."""
_BORDER_STEP = 5e-4


@dataclass(frozen=True)
class Shell:
    """Triangles with corners of their own.

    corners, normals: (k, 3, 3) [m]; uv: (k, 3, 2) material coordinates [m]; source: (k, 3) vertices of the surface.
    """

    corners: Floats
    normals: Floats
    uv: Floats
    source: Ints


def cloth_shell(surface: Surface) -> tuple[Shell, Floats]:
    """The faces, rims and hems of a cloth, and the triangles (k, 3, 3) of its stitches [m]."""
    x, triangles = surface.positions, surface.triangles
    normals = vertex_normals(x, triangles)
    distance, along = _border_distance(surface)
    hemmed = WIDEST_HEM * float(np.ptp(x, axis=0).max()) > HEM_WIDTH
    layers = 1.0 + (HEM_LAYERS - 1.0) * np.clip((HEM_WIDTH - distance) / HEM_SLOPE, 0.0, 1.0) * hemmed
    offset = 0.5 * THICKNESS * layers[:, None] * normals
    front, back = x + offset, x - offset
    uv = material_coordinates(surface)
    edges = _border(triangles)
    rim, rim_normals = _rims(front, back, edges)
    flipped = triangles[:, ::-1]
    shell = Shell(
        np.concatenate([front[triangles], back[flipped], rim]),
        np.concatenate([normals[triangles], -normals[flipped], rim_normals]),
        np.concatenate([uv, uv[:, ::-1], np.zeros((len(rim), 3, 2))]),
        np.concatenate([triangles, flipped, np.repeat(edges[:, :1], 3, axis=1).repeat(2, axis=0)]),
    )
    if not hemmed or not len(edges):
        return shell, np.zeros((0, 3, 3))
    stitches = [_stitches(side, triangles, distance, along) for side in (front, back)]
    return shell, np.concatenate(stitches)


def material_coordinates(surface: Surface) -> Floats:
    """Coordinates of the undeformed cloth at each corner, (m, 3, 2) [m], in the plane that its triangle faces."""
    material = surface.material if len(surface.material) else surface.positions
    corners = material[surface.triangles]
    facing = np.abs(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])).argmax(axis=1)
    axes = np.array([[1, 2], [0, 2], [0, 1]])[facing]
    return np.take_along_axis(corners, np.repeat(axes[:, None], 3, axis=1), axis=2)


def _border(triangles: Ints) -> Ints:
    """Directed edges of exactly one triangle, (b, 2)."""
    directed = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    _, group, count = np.unique(np.sort(directed, axis=1), axis=0, return_inverse=True, return_counts=True)
    return directed[count[group.ravel()] == 1]


def _border_distance(surface: Surface) -> tuple[Floats, Floats]:
    """Distance of each vertex from the border of the undeformed cloth, and the position along it of the nearest point.

    Both (n,) [m]; infinite and 0 without a border.
    """
    material = surface.material if len(surface.material) else surface.positions
    edges = _border(surface.triangles)
    if not len(edges):
        return np.full(len(material), np.inf), np.zeros(len(material))
    start, end = material[edges[:, 0]], material[edges[:, 1]]
    lengths = np.linalg.norm(end - start, axis=1)
    graph = csr_array((lengths, (edges[:, 0], edges[:, 1])), shape=(len(material), len(material)))
    _, seeds = np.unique(connected_components(graph, directed=False)[1], return_index=True)
    from_seed = dijkstra(graph, directed=False, indices=seeds, min_only=True)
    counts = np.maximum(np.ceil(lengths / _BORDER_STEP).astype(np.int64), 1)
    edge = np.repeat(np.arange(len(edges)), counts)
    part = (np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)) / counts[edge]
    points = start[edge] + part[:, None] * (end - start)[edge]
    distance, nearest = cKDTree(points).query(material, workers=1)
    ends = from_seed[edges[edge[nearest]]]
    return distance, ends[:, 0] + part[nearest] * (ends[:, 1] - ends[:, 0])


def _rims(front: Floats, back: Floats, edges: Ints) -> tuple[Floats, Floats]:
    """Two triangles over the thickness at each border edge, and their normals, (2 k, 3, 3) each."""
    a, b, c, d = front[edges[:, 0]], front[edges[:, 1]], back[edges[:, 0]], back[edges[:, 1]]
    corners = np.stack([np.stack([a, d, b], axis=1), np.stack([a, c, d], axis=1)], axis=1).reshape(-1, 3, 3)
    normals = unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    return corners, np.broadcast_to(normals[:, None], corners.shape)


def _stitches(side: Floats, triangles: Ints, distance: Floats, along: Floats) -> Floats:
    """Threads on one face along the line at the distance of a hem from the border: thin prisms, (k, 3, 3) [m]."""
    value = distance[triangles] - 0.9 * HEM_WIDTH
    crossing = (value.min(axis=1) < 0) & (value.max(axis=1) > 0) & np.isfinite(value).all(axis=1)
    corners, value, run = side[triangles[crossing]], value[crossing], along[triangles[crossing]]
    alone = np.where((value < 0).sum(axis=1) == 1, (value < 0).argmax(axis=1), (value >= 0).argmax(axis=1))
    rows = np.arange(len(corners))
    ends, places = [], []
    for other in ((alone + 1) % 3, (alone + 2) % 3):
        t = value[rows, alone] / (value[rows, alone] - value[rows, other])
        ends.append(corners[rows, alone] + t[:, None] * (corners[rows, other] - corners[rows, alone]))
        places.append(run[rows, alone] + t * (run[rows, other] - run[rows, alone]))
    sewn = (0.5 * (places[0] + places[1])) % (STITCH + GAP) < STITCH
    a, b = (each[sewn] for each in ends)
    normal = unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))[sewn]
    aside = THREAD * unit(np.cross(b - a, normal))
    ring = [aside, THREAD * normal, -aside, -THREAD * normal]
    quads = [np.stack([a + p, b + p, b + q, a + q], axis=1) for p, q in zip(ring, ring[1:] + ring[:1], strict=True)]
    faces = np.concatenate(quads) if quads else np.zeros((0, 4, 3))
    return np.concatenate([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]])
