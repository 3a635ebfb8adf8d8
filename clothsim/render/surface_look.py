"""Surface appearance without lighting: normals, colours, smooth surfaces, crosses of strokes, thickness and hems.

Smooth surfaces are by Phong tessellation (Boubekeur and Alexa 2008, equation (2)): a point of an edge is projected onto
the tangent planes of both ends, and their mean, weighted by SHAPE, replaces it. The vertices stay where they are; a
cloth on a ball does not sink into it, as it would with an approximating scheme such as Loop's.

A simulated cloth has no thickness. What makes a drawn one look like cloth are its cut edges: a `Shell` has a rim as
wide as the cloth is thick, a hem of two layers behind it and a row of stitches that holds the hem.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.sparse import csr_array, eye_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from clothsim.base.arrays import Floats, Ints
from clothsim.base.linalg import unit
from clothsim.base.memo import known_for_arrays
from clothsim.base.triangles import (
    area_vectors,
    border_edges,
    connected,
    half_edges,
    triangle_areas,
    unique_edges,
    unit_or,
    vertex_normals,
)
from clothsim.render.colour_scale import Scale, log_stretch, per_vertex

INK = np.array([0.13, 0.13, 0.16])
ACROSS = 22
"""So many crosses stand side by side along the longest side of the cloths, fewer where the triangles are larger."""

HALF_LENGTH, WIDTHS, LIFT = 0.42, (0.11, 0.055), 0.04
"""Half a stroke of stretch 1, the widths of the two strokes and their height over the cloth, in distances of crosses.

The stroke of the larger stretch is the wider one."""


def spacing_of(positions: Floats, triangles: Ints) -> float:
    """Distance between crosses on cloths with vertices (n, 3) and triangles (m, 3) [m]."""
    areas = triangle_areas(positions[triangles])
    return float(max(np.ptp(positions, axis=0).max() / ACROSS, np.sqrt(np.median(areas))))


def evenly_spaced(centres: Floats, spacing: float) -> Ints:
    """Numbers of points, ascending: of `centres (m, 3)` the nearest to the middle of each cell of a grid [m]."""
    cells = np.floor((centres - centres.min(axis=0)) / spacing)
    off_centre = np.linalg.norm((centres - centres.min(axis=0)) / spacing - cells - 0.5, axis=1)
    order = np.lexsort([off_centre, *cells.T])
    first = np.concatenate([[True], (np.diff(cells[order], axis=0) != 0).any(axis=1)])
    return np.sort(order[first])


def crosses(centres: Floats, directions: Floats, stretches: Floats, spacing: float) -> Floats:
    """Two strokes at each of `centres (k, 3)`, their ends (k, 2, 2, 3) [m]: by cross, by stroke, from and to.

    directions: (k, 3, 2) unit columns; stretches: (k, 2), the lengths of the strokes in units of one of stretch 1.
    """
    half = HALF_LENGTH * spacing * np.swapaxes(directions, 1, 2) * stretches[:, :, None]
    return centres[:, None, None, :] + np.stack([-half, half], axis=2)


def ribbons(strokes: Floats, spacing: float) -> tuple[Floats, Floats]:
    """Thin rectangles over both sides of the cloth along strokes (k, 2, 2, 3): corners and normals (8 k, 3, 3)."""
    along = strokes[:, :, 1] - strokes[:, :, 0]
    normals = unit(np.cross(along[:, 0], along[:, 1]))[:, None, :]
    aside = 0.5 * spacing * np.array(WIDTHS)[None, :, None] * unit(np.cross(normals, along))
    corners, facing = [], []
    for side in (LIFT * spacing, -LIFT * spacing):
        start, end = (strokes[:, :, k] + side * normals for k in (0, 1))
        quads = np.stack([start - aside, end - aside, end + aside, start + aside], axis=2).reshape(-1, 4, 3)
        corners += [quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]
        outward = np.broadcast_to(np.sign(side) * normals, along.shape).reshape(-1, 1, 3)
        facing += 2 * [np.broadcast_to(outward, (len(quads), 3, 3))]
    return np.concatenate(corners), np.concatenate(facing)


BODY_GREY = np.array([0.70, 0.70, 0.71])
FABRICS = np.array([[0.46, 0.60, 0.72], [0.80, 0.63, 0.45], [0.56, 0.68, 0.55], [0.72, 0.55, 0.62]])
_BACK = np.array([0.84, 0.84, 0.87])
_COS_CREASE = np.cos(np.radians(50.0))


@dataclass(frozen=True)
class Surface:
    """One cloth or body at one time.

    positions: (n, 3) [m]; triangles: (m, 3); role: "cloth" or "body"; principal_stretches: (m, 2), or empty (0, 2)
    where they are not known, which draws the cloth in its plain colour; values: (n,) that colour the cloth instead, or
    empty; strokes: (k, 2, 2, 3) ends of crosses drawn on it [m], `spacing` [m] apart; fabrics: (m,) number of the
    fabric of each triangle, which has a plain colour of its own, or empty; material: (n, 3) positions of the
    undeformed cloth that a weave is fixed to [m], or empty; kind: of cloth, a key of `cloth_kinds.KINDS`.
    """

    name: str
    positions: Floats
    triangles: Ints
    role: str
    principal_stretches: Floats
    values: Floats = field(default_factory=lambda: np.zeros(0))
    strokes: Floats = field(default_factory=lambda: np.zeros((0, 2, 2, 3)))
    spacing: float = 0.0
    fabrics: Ints = field(default_factory=lambda: np.zeros(0, np.int64))
    material: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    kind: str = "plain"


@dataclass(frozen=True)
class Look:
    """Triangles with corners of their own: positions [m], unit normals, sRGB of front and back, each (m, 3, 3)."""

    corners: Floats
    normals: Floats
    front: Floats
    back: Floats


def looks(surfaces: Sequence[Surface], scale: Scale | None, dyes: Floats | None = None) -> list[Look]:
    """The look of each surface and of the strokes on it; cloth by its values or else its log l, plain without scale.

    dyes: (k, 2, 3) sRGB of the threads of plain cloths, whose mean is seen.
    """
    made, n_cloths = [], 0
    for surface in surfaces:
        corners = surface.positions[surface.triangles]
        if surface.role == "body":
            paint = np.broadcast_to(BODY_GREY, corners.shape)
            made.append(Look(corners, creased_normals(surface.positions, surface.triangles), paint, paint))
            continue
        values = vertex_values(surface)
        if scale is not None and len(values):
            front = scale.colours(values)[surface.triangles]
        elif dyes is not None:
            front = np.broadcast_to(dyes[n_cloths % len(dyes)].mean(axis=0), corners.shape)
        else:
            numbers = surface.fabrics if len(surface.fabrics) else np.zeros(len(corners), np.int64)
            front = np.broadcast_to(FABRICS[(n_cloths + numbers) % len(FABRICS), None], corners.shape)
        n_cloths += 1
        normals = vertex_normals(surface.positions, surface.triangles)[surface.triangles]
        made.append(Look(corners, normals, front, front * _BACK))
        if len(surface.strokes):
            corners, normals = ribbons(surface.strokes, surface.spacing)
            paint = np.broadcast_to(INK, corners.shape)
            made.append(Look(corners, normals, paint, paint))
    return made


def vertex_values(surface: Surface) -> Floats:
    """The numbers at the vertices (n,) that colour a cloth; none where they are not known."""
    if len(surface.values) or not len(surface.principal_stretches):
        return surface.values
    return per_vertex(log_stretch(surface.principal_stretches), surface.positions, surface.triangles)


@known_for_arrays
def creased_normals(positions: Floats, triangles: Ints) -> Floats:
    """Unit normals at the corners, (m, 3, 3): the mean over the triangles at the vertex within 50 degrees of its own.

    So a box keeps its edges and a body is smooth.
    """
    doubled = area_vectors(positions[triangles])
    unit = unit_or(doubled, (0.0, 0.0, 1.0))
    n_corners = triangles.size
    rows = np.arange(n_corners)
    at_vertex = csr_array((np.ones(n_corners), (triangles.ravel(), rows // 3)), shape=(len(positions), len(triangles)))
    pairs = at_vertex[triangles.ravel()].tocoo()
    alike = np.einsum("ij,ij->i", unit[pairs.row // 3], unit[pairs.col]) > _COS_CREASE
    row, col = pairs.row[alike], pairs.col[alike]
    summed = [np.bincount(row, doubled[col, k], minlength=n_corners) for k in range(3)]
    return unit_or(np.column_stack(summed), (0.0, 0.0, 1.0)).reshape(-1, 3, 3)


SHAPE = 0.5
"""Weight of the projections; 0 leaves the triangles flat. With a half the middles of edges lie on a ball whose surface
the vertices are on, to fourth order in the angle; the paper takes 3/4 and bulges more."""
LEVELS = 2
"""Bound on the halvings of an edge."""
MOST_TRIANGLES = 60_000
"""Triangles beyond which a surface is fine enough as it is."""
COS_FLAT = 0.99
"""Cosine of the angle between a normal of a vertex and their mean, 8 degrees, beyond which there is a crease."""
COS_SHARP = 0.5
"""Cosine of the angle between the normals of two ends, 60 degrees, beyond which the middle of their edge stays: in a
fold as tight as the mesh the smooth sheets would cross."""


CLEARANCE = 0.03
"""A surface stays as it is within this distance of a vertex of another one [m]: rounded, one could show through."""
RINGS = 3
"""Edges between two vertices beyond which they are of different layers, though they are near."""


def subdivided(surface: Surface, others: Sequence[Surface] = ()) -> Surface:
    """A cloth with its edges halved up to LEVELS times; a body, a fine cloth or one with strokes as it is.

    It is round where no other cloth is near, and no other layer of its own.
    """
    if surface.role != "cloth" or len(surface.strokes):
        return surface
    x, triangles = surface.positions, surface.triangles
    values, material = vertex_values(surface), surface.material
    near = _tree_of(others)
    for _ in range(LEVELS):
        if 4 * len(triangles) > MOST_TRIANGLES:
            break
        x, triangles, edges = _halved(x, triangles, _is_near(x, near) | _is_near_itself(x, triangles))
        values, material = _append_means(values, edges), _append_means(material, edges)
    parts = len(triangles) // max(len(surface.triangles), 1)
    whole = replace(surface, positions=x, triangles=triangles, principal_stretches=np.zeros((0, 2)))
    return replace(whole, values=values, material=material, fabrics=np.repeat(surface.fabrics, parts))


def _tree_of(surfaces: Sequence[Surface]) -> cKDTree:
    return cKDTree(np.concatenate([np.zeros((0, 3)), *(each.positions for each in surfaces)]))


def _is_near(x: Floats, others: cKDTree) -> np.ndarray:
    """True for each point (n, 3) within CLEARANCE of a point of others."""
    return np.asarray(others.query(x, distance_upper_bound=CLEARANCE, workers=1)[0] < CLEARANCE)


def _is_near_itself(x: Floats, triangles: Ints) -> np.ndarray:
    """True for each vertex (n,) that is near one of another layer: one that faces away, or RINGS edges farther.

    Near is within the mean length of the edges: rounding moves the middle of an edge by less.
    """
    edges = unique_edges(triangles)
    length = float(np.linalg.norm(x[edges[:, 0]] - x[edges[:, 1]], axis=1).mean())
    first, second = cKDTree(x).query_pairs(length, output_type="ndarray").T
    joined = csr_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(len(x), len(x)))
    one_edge = joined + joined.T + eye_array(len(x), format="csr")
    along = one_edge
    for _ in range(RINGS - 1):
        along = along @ one_edge
    normals = vertex_normals(x, triangles)
    facing_away = np.einsum("ij,ij->i", normals[first], normals[second]) < 0
    apart = facing_away | (np.asarray(along[first, second]).ravel() == 0)
    near = np.zeros(len(x), bool)
    near[first[apart]] = near[second[apart]] = True
    return near


def rounded(body: Surface, cloths: Sequence[Surface]) -> Surface:
    """A body with its edges halved up to LEVELS times, round where it has no crease and no cloth is near."""
    x, triangles = body.positions, body.triangles
    near = _tree_of(cloths)
    for _ in range(LEVELS):
        if 4 * len(triangles) > MOST_TRIANGLES:
            break
        mean = vertex_normals(x, triangles)[triangles]
        bent = np.einsum("ijk,ijk->ij", mean, creased_normals(x, triangles)) < COS_FLAT
        fixed = np.zeros(len(x), bool)
        fixed[triangles[bent]] = True
        fixed |= _is_near(x, near)
        x, triangles, _ = _halved(x, triangles, fixed)
    return replace(body, positions=x, triangles=triangles)


def _append_means(values: Floats, edges: Ints) -> Floats:
    """Numbers at the vertices, if there are any, and at the middles of the edges."""
    return np.concatenate([values, values[edges].mean(axis=1)]) if len(values) else values


def _halved(x: Floats, triangles: Ints, fixed: np.ndarray) -> tuple[Floats, Ints, Ints]:
    """Vertices and triangles with each triangle in four, and the edges (k, 2) whose middles are the new vertices.

    fixed: (n,) True for the vertices whose edges stay straight.
    """
    sides = np.sort(half_edges(triangles), axis=1)
    edges, number = np.unique(sides, axis=0, return_inverse=True)
    a, b, c = triangles.T
    ab, bc, ca = (number.reshape(-1, 3) + len(x)).T
    quarters = np.stack([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]], axis=0)
    ends, n = x[edges], vertex_normals(x, triangles)[edges]
    middle = ends.mean(axis=1)
    off = np.einsum("ijk,ijk->ij", middle[:, None] - ends, n)
    bulge = -(off[..., None] * n).mean(axis=1)
    turned = (np.einsum("ik,ik->i", n[:, 0], n[:, 1]) < COS_SHARP) | fixed[edges].any(axis=1)
    middles = middle + SHAPE * np.where(turned[:, None], 0.0, bulge)
    return np.concatenate([x, middles]), quarters.transpose(2, 0, 1).reshape(-1, 3), edges


FAIRING = 10
"""Steps of smoothing: they reach about one edge of the mesh before it was halved twice."""
FARTHEST, OF_EDGE = 5e-4, 0.15
"""How far smoothing moves a vertex [m]: half the thickness that is drawn; and relative to the median edge."""


def faired(x: Floats, triangles: Ints) -> Floats:
    """Positions (n, 3) [m] of a cloth without the facets of its coarse mesh, near those that were simulated.

    Vertices go half the way to the mean of their neighbours, those of the border to the mean along the border.
    """
    ends, border = half_edges(triangles), border_edges(triangles)[0]
    on_border = np.zeros(len(x), bool)
    on_border[border] = True
    inner = ends[~on_border[ends].all(axis=1)]
    row, column = np.concatenate([inner, inner[:, ::-1], border, border[:, ::-1]]).T
    counts = ~on_border[row] | on_border[column]
    near = csr_array((np.ones(counts.sum()), (row[counts], column[counts])), shape=(len(x), len(x)))
    number = near.sum(axis=1)[:, None]
    smooth = x
    for _ in range(FAIRING):
        smooth = np.where(number > 0, 0.5 * (smooth + near @ smooth / np.maximum(number, 1.0)), x)
    moved = smooth - x
    limit = min(FARTHEST, OF_EDGE * float(np.median(np.linalg.norm(x[ends[:, 1]] - x[ends[:, 0]], axis=1))))
    return x + moved * np.minimum(1.0, limit / np.maximum(np.linalg.norm(moved, axis=1, keepdims=True), 1e-12))


THICKNESS, HEM_LAYERS = 1.0e-3, 2.2
"""Thickness that is drawn [m], and the factor on it in a hem. Contact keeps layers about as far apart."""
THICKEST = 0.004
"""Largest thickness that is drawn, relative to the size of the cloth: one of a millimetre is not a block."""
HEM_WIDTH, HEM_SLOPE = 0.018, 0.0015
"""Width of a hem, and of the step at its end [m]."""
STITCH, GAP, THREAD = 0.0034, 0.0014, 0.0003
"""Length of a stitch, the gap behind it, and the radius of its thread [m]."""
WIDEST_HEM = 0.06
"""Largest hem relative to the size of the cloth: a card has none."""
_BORDER_STEP, _MOST_STEPS = 5e-4, 1_000_000


@dataclass(frozen=True)
class Shell:
    """Triangles with corners of their own.

    corners, normals: (k, 3, 3) [m]; uv: (k, 3, 2) material coordinates [m]; source: (k, 3) vertices of the surface.
    """

    corners: Floats
    normals: Floats
    uv: Floats
    source: Ints


def cloth_shell(surface: Surface, pixel: float = 0.0, hem: bool = True) -> tuple[Shell, Floats]:
    """The faces, rims and hems of a cloth, and the triangles (k, 3, 3) of its stitches [m].

    pixel: width of one on the cloth [m]; stitches that are narrower are a line as wide as it; hem: False for a cloth
    that is cut.
    """
    triangles = surface.triangles
    x = faired(surface.positions, triangles)
    normals = vertex_normals(x, triangles)
    distance, along = _border_distance(surface)
    size = float(np.ptp(x, axis=0).max())
    hemmed = hem and WIDEST_HEM * size > HEM_WIDTH
    layers = 1.0 + (HEM_LAYERS - 1.0) * np.clip((HEM_WIDTH - distance) / HEM_SLOPE, 0.0, 1.0) * hemmed
    offset = 0.5 * min(THICKNESS, THICKEST * size) * layers[:, None] * normals
    front, back = x + offset, x - offset
    uv = material_coordinates(surface)
    edges = border_edges(triangles)[0]
    # two triangles over the thickness at each border edge, and their normals, (2 k, 3, 3) each
    a, b, c, d = front[edges[:, 0]], front[edges[:, 1]], back[edges[:, 0]], back[edges[:, 1]]
    rim = np.stack([np.stack([a, d, b], axis=1), np.stack([a, c, d], axis=1)], axis=1).reshape(-1, 3, 3)
    rim_normals = np.broadcast_to(unit(area_vectors(rim))[:, None], rim.shape)
    flipped = triangles[:, ::-1]
    shell = Shell(
        np.concatenate([front[triangles], back[flipped], rim]),
        np.concatenate([normals[triangles], -normals[flipped], rim_normals]),
        np.concatenate([uv, uv[:, ::-1], np.zeros((len(rim), 3, 2))]),
        np.concatenate([triangles, flipped, np.repeat(edges[:, :1], 3, axis=1).repeat(2, axis=0)]),
    )
    if not hemmed or not len(edges):
        return shell, np.zeros((0, 3, 3))
    radius, gap = (THREAD, GAP) if pixel < 2.0 * THREAD else (0.5 * pixel, 0.0)
    stitches = [_stitches(side, triangles, distance, along, radius, gap) for side in (front, back)]
    return shell, np.concatenate(stitches)


SPREADS = 60
"""Times that the vectors of triangles are summed over their neighbours: the plane that a garment is seen in changes
along one line at its sides then, and not from fold to fold."""


def material_coordinates(surface: Surface) -> Floats:
    """Coordinates of the undeformed cloth at each corner, (m, 3, 2) [m], in the plane that it faces thereabouts."""
    material, triangles = surface.material if len(surface.material) else surface.positions, surface.triangles
    corners = material[triangles]
    rows = np.arange(triangles.size) // 3
    at_vertex = csr_array((np.ones(triangles.size), (triangles.ravel(), rows)), shape=(len(material), len(triangles)))
    facing = area_vectors(corners)
    for _ in range(SPREADS):
        facing = at_vertex.T @ unit(at_vertex @ facing)
    facing = np.abs(facing).argmax(axis=1)
    axes = np.array([[1, 2], [0, 2], [0, 1]])[facing]
    return np.take_along_axis(corners, np.repeat(axes[:, None], 3, axis=1), axis=2)


def _border_distance(surface: Surface) -> tuple[Floats, Floats]:
    """Distance of each vertex from the border of the undeformed cloth, and the position along it of the nearest point.

    Both (n,) [m]; infinite and 0 without a border.
    """
    material = surface.material if len(surface.material) else surface.positions
    edges = border_edges(surface.triangles)[0]
    if not len(edges):
        return np.full(len(material), np.inf), np.zeros(len(material))
    start, end = material[edges[:, 0]], material[edges[:, 1]]
    lengths = np.linalg.norm(end - start, axis=1)
    graph = csr_array((lengths, (edges[:, 0], edges[:, 1])), shape=(len(material), len(material)))
    _, seeds = np.unique(connected(edges[:, 0], edges[:, 1], len(material)), return_index=True)
    from_seed = dijkstra(graph, directed=False, indices=seeds, min_only=True)
    step = max(_BORDER_STEP, float(lengths.sum()) / _MOST_STEPS)  # a cloth in other units has kilometres of border
    counts = np.maximum(np.ceil(lengths / step).astype(np.int64), 1)
    edge = np.repeat(np.arange(len(edges)), counts)
    part = (np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)) / counts[edge]
    points = start[edge] + part[:, None] * (end - start)[edge]
    distance, nearest = cKDTree(points).query(material, workers=1)
    ends = from_seed[edges[edge[nearest]]]
    return distance, ends[:, 0] + part[nearest] * (ends[:, 1] - ends[:, 0])


def _stitches(side: Floats, triangles: Ints, distance: Floats, along: Floats, radius: float, gap: float) -> Floats:
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
    sewn = (0.5 * (places[0] + places[1])) % (STITCH + gap) < STITCH
    a, b = (each[sewn] for each in ends)
    normal = unit(area_vectors(corners))[sewn]
    aside = radius * unit(np.cross(b - a, normal))
    ring = [aside, THREAD * normal, -aside, -THREAD * normal]
    quads = [np.stack([a + p, b + p, b + q, a + q], axis=1) for p, q in zip(ring, ring[1:] + ring[:1], strict=True)]
    faces = np.concatenate(quads) if quads else np.zeros((0, 4, 3))
    return np.concatenate([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]])
