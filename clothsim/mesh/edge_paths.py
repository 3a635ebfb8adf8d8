"""Paths of vertices along the edges of a mesh: a line that somebody drew, snapped to it."""

import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.errors import InputError

STRAYING = 2.0
"""How much an edge at one median length from the line is lengthened, beyond itself: ways near the line are shorter."""


def path_along(where: str, positions: Floats, edges: Ints, points: Floats) -> Ints:
    """The vertices (k,) of the shortest way along `edges (e, 2)` from point to point of a drawn line, (p, 3) [m].

    positions (n, 3) [m]. Each point counts as its nearest vertex on an edge. An edge counts longer the further its
    middle is from the line, so that the way keeps to it on any mesh. InputError where there are fewer than two points,
    where one is further from the mesh than an edge is long, or no way leads from one to the next.
    """
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import dijkstra

    if len(points) < 2:
        raise InputError(f"{where} has {len(points)} points.", "A line has two or more: [[x, y, z], [x, y, z]].")
    if not len(edges):
        raise InputError(f"{where}: the mesh has no such edge.")
    ends = positions[edges]
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    usual = float(np.median(lengths))
    stops = _nearest(where, positions, np.unique(edges), points, usual)
    path = [stops[:1]]
    for k in range(len(stops) - 1):
        away = _distance_to_segment(ends.mean(axis=1), points[k], points[k + 1])
        graph = csr_array((lengths * (1 + STRAYING * (away / usual) ** 2), tuple(edges.T)), shape=(len(positions),) * 2)
        before = dijkstra(graph, directed=False, indices=stops[k], return_predecessors=True)[1]
        path.append(_back(where, before, int(stops[k]), int(stops[k + 1])))
    return np.concatenate(path)


def _nearest(where: str, positions: Floats, vertices: Ints, points: Floats, reach: float) -> Ints:
    """The one of `vertices` nearest to each point, (p,)."""
    distances = np.linalg.norm(positions[vertices] - points[:, None], axis=2)
    off = np.flatnonzero(distances.min(axis=1) > reach)
    if off.size:
        raise InputError(
            f"{where}[{off[0]}] is {distances[off[0]].min():.3g} m from the mesh at rest.",
            "Draw the line in the coordinates of the mesh before it is placed.",
        )
    return vertices[distances.argmin(axis=1)]


def _distance_to_segment(points: Floats, start: Floats, end: Floats) -> Floats:
    """How far each of `points (n, 3)` is from the segment, (n,) [m]."""
    along = end - start
    squared = float(along @ along)
    place = np.clip((points - start) @ along / squared, 0.0, 1.0) if squared else np.zeros(len(points))
    return np.asarray(np.linalg.norm(points - start - place[:, None] * along, axis=1), np.float64)


def _back(where: str, before: Ints, first: int, last: int) -> Ints:
    """The way to `last` from the vertex before each vertex, without `first`."""
    way = []
    while last != first:
        if last < 0:
            raise InputError(f"{where}: no way along the edges leads from one point to the next.")
        way.append(last)
        last = int(before[last])
    return np.array(way[::-1], np.int64)
