"""Edge-triangle intersections, their contours, the curves that these make on the surfaces, and the regions within.

Baraff, Witkin & Kass 2003, section 4. Which pairs of triangles intersect is decided by the exact check; where they do
is needed to a few digits only, in doubles. Two triangles intersect in a segment; segments that end in the same
edge-triangle intersection are joined, and make a contour. On the surfaces a contour is two curves, one on either side
of each segment; where neighbours pass through one another the two meet in the vertex that they share, and are one.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clothsim.base.arrays import Floats, Ints
from clothsim.base.triangles import connected, thirds_at_vertices
from clothsim.mesh.topology import unique_edges

SLACK = 1e-9
"""Barycentric coordinates above minus this are inside a triangle."""


@dataclass(frozen=True)
class EdgeTriangleIntersections:
    """Points where edges pierce triangles, each once, however many pairs it belongs to.

    Parameters
    ----------
    edges : (k, 2) int64
        Vertices of each edge, the lower first.
    faces : (k,) int64
        Triangle that it pierces.
    along : (k,) float64
        Position on the edge: 0 at its first vertex, 1 at its second.
    barycentric : (k, 3) float64
        Position in the triangle.
    normals : (k, 3) float64
        Unit normal of the triangle.
    depths : (k, 2) float64
        Signed distances of the ends of the edge from the plane of the triangle [m]: of opposite signs.
    of_pair : (q, 3) int64
        Incidences: intersection, pair, and which triangle of the pair the edge is of (0 or 1).
    """

    edges: Ints
    faces: Ints
    along: Floats
    barycentric: Floats
    normals: Floats
    depths: Floats
    of_pair: Ints


def edge_triangle_intersections(x: Floats, triangles: Ints, pairs: Ints) -> EdgeTriangleIntersections:
    """Return the intersections of intersecting `pairs (p, 2)` of `triangles (m, 3)`.

    Parameters
    ----------
    x : (n, 3) array
        Positions [m].
    triangles : (m, 3) int array
        Vertex indices.
    pairs : (p, 2) int array
        Triangles that intersect.

    Examples
    --------
    >>> x = np.array([[0.0, 0, 0], [4, 0, 0], [0, 4, 0], [1, 1, -1], [1, 1, 1], [9, 9, 0]])
    >>> found = edge_triangle_intersections(x, np.array([[0, 1, 2], [3, 4, 5]]), np.array([[0, 1]]))
    >>> found.edges.tolist(), found.along.tolist()
    ([[1, 2], [3, 4]], [0.5, 0.5])
    """
    # edges of one triangle of each pair that have no vertex of the other, those others, and (pair, role) of each
    listed: list[tuple[Ints, Ints, Ints]] = []
    for role in (0, 1):
        own, other = triangles[pairs[:, role]], pairs[:, 1 - role]
        for k in range(3):
            edge = np.sort(own[:, [k, (k + 1) % 3]], axis=1)
            rows = np.flatnonzero(~(edge[:, :, None] == triangles[other][:, None, :]).any(axis=(1, 2)))
            listed.append((edge[rows], other[rows], np.column_stack([rows, np.full(len(rows), role)])))
    edges, faces, origin = (np.concatenate(each) for each in zip(*listed, strict=True))
    p, q = x[edges[:, 0]], x[edges[:, 1]]
    a, b, c = (x[triangles[faces, corner]] for corner in range(3))
    normals = np.cross(b - a, c - a)
    size = np.linalg.norm(normals, axis=1)
    normals /= np.where(size > 0, size, 1.0)[:, None]
    depths = np.column_stack([np.einsum("ij,ij->i", normals, end - a) for end in (p, q)])
    apart = depths[:, 0] - depths[:, 1]
    along = depths[:, 0] / np.where(apart != 0, apart, 1.0)
    point = p + along[:, None] * (q - p)
    doubled = np.where(size > 0, size, 1.0)
    at_b = np.einsum("ij,ij->i", np.cross(point - a, c - a), normals) / doubled
    at_c = np.einsum("ij,ij->i", np.cross(b - a, point - a), normals) / doubled
    barycentric = np.column_stack([1 - at_b - at_c, at_b, at_c])
    there = (apart != 0) & (size > 0) & (along >= 0) & (along <= 1) & (barycentric >= -SLACK).all(axis=1)
    key = np.column_stack([edges, faces])[there]
    _, first, number = np.unique(key, axis=0, return_index=True, return_inverse=True)
    rows = np.flatnonzero(there)[first]
    incidences = np.column_stack([number.ravel(), origin[there]])
    return EdgeTriangleIntersections(
        edges[rows], faces[rows], along[rows], barycentric[rows], normals[rows], depths[rows], incidences
    )


@dataclass(frozen=True)
class Contours:
    """Contours and curves of a set of intersections.

    Parameters
    ----------
    contour : (k,) int64
        Contour of each intersection.
    edge_curve, face_curve : (k,) int64
        Curve on the surface of its edge, which cuts the edge, and on that of its triangle, which passes inside.
    n_contours, n_curves : int
        Their numbers.
    contour_of_curve : (n_curves,) int64
        Contour that each curve is of; -1 for one without an intersection.
    """

    contour: Ints
    edge_curve: Ints
    face_curve: Ints
    n_contours: int
    n_curves: int
    contour_of_curve: Ints


def contours(found: EdgeTriangleIntersections, n_pairs: int) -> Contours:
    """Return the contours of intersections of `n_pairs` pairs of triangles."""
    intersection, pair, role = found.of_pair.T
    k = len(found.edges)
    contour = connected(intersection, k + pair, k + n_pairs)[:k]
    # a node (pair, role) is a segment on one of its two surfaces; those at one intersection continue one another
    order = np.argsort(intersection, kind="stable")
    same = np.diff(intersection[order]) == 0
    one, other = order[:-1][same], order[1:][same]
    own, opposite = 2 * pair + role, 2 * pair + 1 - role
    curve = connected(
        np.concatenate([own[one], opposite[one]]), np.concatenate([own[other], opposite[other]]), 2 * n_pairs
    )
    first = np.zeros(k, np.int64)
    first[intersection[::-1]] = np.arange(len(intersection))[::-1]
    edge_curve, face_curve = curve[own[first]], curve[opposite[first]]
    n_curves = int(curve.max(initial=-1)) + 1
    of_curve = np.full(n_curves, -1)
    of_curve[edge_curve], of_curve[face_curve] = contour, contour
    numbers, dense = np.unique(contour, return_inverse=True)
    of_curve[of_curve >= 0] = np.searchsorted(numbers, of_curve[of_curve >= 0])
    return Contours(dense.ravel(), edge_curve, face_curve, len(numbers), n_curves, of_curve)


# Regions of surfaces that intersection curves bound: flood fill, and which side of a curve is inside.
#
# All cut edges are removed and the rest is filled once into patches; the two sides of one curve are then unions of
# patches, joined over the edges that other curves cut. The smaller side, by area, is inside; one that was inside before
# stays so. A curve whose cut edges do not separate their ends is open: it ends inside the surface.


Flags = NDArray[np.bool_]
MOSTLY = 0.5
"""Fraction of the area of a side that was inside before, above which it is again."""


@dataclass(frozen=True)
class FilledMesh:
    """Surfaces that are filled.

    triangles (m, 3); edges (e, 2), sorted; areas (n,) of the vertices at rest [m2].
    """

    triangles: Ints
    edges: Ints
    areas: Floats


def make_mesh(triangles: Ints, areas: Floats, n_vertices: int) -> FilledMesh:
    """Return the surfaces of `triangles (m, 3)` with `areas (m,)` [m2]."""
    of_vertices = thirds_at_vertices(areas, triangles, n_vertices)
    return FilledMesh(triangles, unique_edges(triangles), of_vertices)


@dataclass(frozen=True)
class InsideEnds:
    """Inside ends of cut edges.

    Parameters
    ----------
    inner : (k,) int64
        Which end (0 or 1) of each intersection's edge is to move through its triangle; -1: none.
    is_open : (k,) bool
        Intersections of contours none of whose curves separates its surface.
    inside : (n,) bool
        Vertices of the regions that are to pass through the other surface.
    """

    inner: Ints
    is_open: Flags
    inside: Flags


@dataclass(frozen=True)
class Region:
    """Inside of one curve.

    intersections (k,) of the curve; inner (k,): inner end of each edge; vertices (n,) bool; area [m2]; is_disc; is_old:
    True where most of it was inside before.
    """

    intersections: Ints
    inner: Ints
    vertices: Flags
    area: float
    is_disc: bool
    is_old: bool


def inner_ends(mesh: FilledMesh, found: EdgeTriangleIntersections, graph: Contours, inside_before: Flags) -> InsideEnds:
    """Return the inside end of each intersection's edge: of one curve for each contour."""
    n = len(mesh.areas)
    rows = np.searchsorted(mesh.edges[:, 0] * n + mesh.edges[:, 1], found.edges[:, 0] * n + found.edges[:, 1])
    uncut = np.ones(len(mesh.edges), bool)
    uncut[rows] = False
    patch = connected(mesh.edges[uncut, 0], mesh.edges[uncut, 1], n)
    regions: dict[int, list[Region]] = {}
    for curve in np.unique(graph.edge_curve):
        own = np.flatnonzero(graph.edge_curve == curve)
        region = _region(mesh, found, patch, rows, own, inside_before)
        if region is not None:
            regions.setdefault(int(graph.contour_of_curve[curve]), []).append(region)
    inner, inside = np.full(len(rows), -1), np.zeros(n, bool)
    for candidates in regions.values():
        # the old of two, else the one that is not a disc, else the smaller: an end of a tube can pass through the disc
        # that it cuts out of a sheet, the disc cannot pass through the tube
        chosen = min(candidates, key=lambda each: (not each.is_old, each.is_disc, each.area, each.intersections[0]))
        inner[chosen.intersections] = chosen.inner
        inside |= chosen.vertices
    return InsideEnds(inner, ~np.isin(graph.contour, list(regions)), inside)


def _region(
    mesh: FilledMesh, found: EdgeTriangleIntersections, patch: Ints, rows: Ints, own: Ints, before: Flags
) -> Region | None:
    """The smaller side of the curve with the intersections `own`, of edges `rows`; None for an open curve."""
    times = np.zeros(rows.max(initial=-1) + 1, np.int64)
    np.add.at(times, rows[own], 1)
    one, other = patch[found.edges[times[rows] % 2 == 0]].T  # an edge that the curve cuts an odd number of times parts
    side = connected(one, other, int(patch.max(initial=-1)) + 1)[patch]
    one, other = (side[found.edges[own, end]] for end in (0, 1))
    cut = one != other
    if not cut.any():
        return None
    area = np.bincount(side, mesh.areas)
    old = np.bincount(side, mesh.areas * before) / np.where(area > 0, area, 1.0)
    # least first: what was inside before, then the smaller, then by number, so that equal ones differ
    rank = np.empty(len(area), np.int64)
    rank[np.lexsort((area, old <= MOSTLY))] = np.arange(len(area))
    other_inside = rank[other] < rank[one]
    numbers = np.unique(np.where(other_inside, other, one)[cut])
    vertices = np.isin(side, numbers)
    whole = float(area[numbers].sum())
    is_old = float((area * old)[numbers].sum()) > MOSTLY * whole
    edges, faces = (np.count_nonzero(vertices[each].all(axis=1)) for each in (mesh.edges, mesh.triangles))
    is_disc = bool(np.count_nonzero(vertices) - edges + faces == 1)  # its Euler characteristic
    return Region(own, np.where(cut, other_inside, -1), vertices, whole, is_disc, is_old)
