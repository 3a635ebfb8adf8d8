"""Culling of box pairs by separating directions along linear paths.

Boxes are loose for cloth: on a long path they overlap those of all neighbours, which move together. Along a fixed
direction m the bodies of a pair are at least min m . x_j - max m . x_i apart. On the path x + t dx that is a concave
function of t (a minimum of linear functions, less a maximum), so its smallest value is at one of the ends, and a pair
is culled where it exceeds |m| times the distance in question. Two directions are tried: between the centroids, which is
cheap and separates most pairs, and between the closest points at the start, which separates all pairs without relative
motion.
"""

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.jit import part
from clothsim.base.vectors import dot
from clothsim.physics.contact.closest_points import Point, edge_edge_closest, point_triangle_closest

ROUND_OFF_FACTOR = 1.0 + 1e-9
"""Enlargement of the distance: products of coordinates are rounded, and an additional pair costs nothing."""

Vertices = tuple[Point, Point, Point, Point]


@part
def separated_by_centroids(x: Vertices, y: Vertices, is_edges: bool, distance_squared: float) -> bool:
    """True where the direction between the centroids proves that two edges, or a point and a triangle, stay apart.

    x, y: their vertices at the start and end of the path; distance_squared: of the distance in question, times
    ROUND_OFF_FACTOR^2 [m2].
    """
    return _separated_along(_centroid_difference(x, is_edges), x, y, is_edges, distance_squared)


@part
def distance_unless_separated(x: Vertices, y: Vertices, is_edges: bool, distance_squared: float) -> float:
    """Distance at the start of the path [m]; -1 where the closest points prove that the two stay apart.

    A non-finite distance is returned as 0: they may be anywhere.
    """
    m = _closest_difference(x, is_edges)
    if dot(m, m) <= distance_squared or not _separated_along(m, x, y, is_edges, distance_squared):
        length = np.sqrt(dot(m, m))
        return length if length >= 0.0 else 0.0
    return -1.0


@part
def vertex_rows(a: Ints, i: int, b: Ints, j: int, is_edges: bool) -> tuple[int, int, int, int]:
    """Rows of x of both elements: of two edges, or of a point and a triangle."""
    if is_edges:
        return a[i, 0], a[i, 1], b[j, 0], b[j, 1]
    return a[i, 0], b[j, 0], b[j, 1], b[j, 2]


@part
def have_common_vertex(rows: tuple[int, int, int, int], is_edges: bool) -> bool:
    """True where two edges, or a point and a triangle, have a vertex in common."""
    i, j, k, m = rows
    if is_edges:
        return (i == k) | (i == m) | (j == k) | (j == m)
    return (i == j) | (i == k) | (i == m)


@part
def relative_vertices(x: Floats, rows: tuple[int, int, int, int]) -> Vertices:
    """Vertices relative to the first one: a common translation has no effect."""
    i, j, k, m = rows
    o = x[i, 0], x[i, 1], x[i, 2]
    return (
        (0.0, 0.0, 0.0),
        (x[j, 0] - o[0], x[j, 1] - o[1], x[j, 2] - o[2]),
        (x[k, 0] - o[0], x[k, 1] - o[1], x[k, 2] - o[2]),
        (x[m, 0] - o[0], x[m, 1] - o[1], x[m, 2] - o[2]),
    )


@part
def _centroid_difference(x: Vertices, is_edges: bool) -> Point:
    """Difference of the centroids, times the number of vertices of one element."""
    _, p, q, r = x
    if is_edges:
        return q[0] + r[0] - p[0], q[1] + r[1] - p[1], q[2] + r[2] - p[2]
    return p[0] + q[0] + r[0], p[1] + q[1] + r[1], p[2] + q[2] + r[2]


@part
def _separated_along(m: Point, x: Vertices, y: Vertices, is_edges: bool, distance_squared: float) -> bool:
    """True where the two are further apart along m than the given distance at both ends, and so on the path."""
    gap = min(_projected_gap(m, x, is_edges), _projected_gap(m, y, is_edges))
    return (gap > 0.0) & (gap * gap > distance_squared * dot(m, m))


@part
def _projected_gap(m: Point, x: Vertices, is_edges: bool) -> float:
    """min m . x_b - max m . x_a."""
    p, q, r = dot(m, x[1]), dot(m, x[2]), dot(m, x[3])
    return min(q, r) - max(p, 0.0) if is_edges else min(p, q, r)


@part
def _closest_difference(x: Vertices, is_edges: bool) -> Point:
    """Vector from the first element's closest point to that of the second."""
    if is_edges:
        s, t = edge_edge_closest(x[0], x[1], x[2], x[3])
        return _weighted(x, -s, 1.0 - t, t)
    u, v, w = point_triangle_closest(x[0], x[1], x[2], x[3])
    return _weighted(x, u, v, w)


@part
def _weighted(x: Vertices, u: float, v: float, w: float) -> Point:
    _, p, q, r = x
    return (
        u * p[0] + v * q[0] + w * r[0],
        u * p[1] + v * q[1] + w * r[1],
        u * p[2] + v * q[2] + w * r[2],
    )
