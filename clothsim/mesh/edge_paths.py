"""Shortest paths of vertices along mesh edges that follow a drawn polyline."""

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError

STRAYING = 2.0
"""Relative lengthening of an edge one median length from the polyline: paths near it become shorter."""


def path_along(where: str, positions: Floats, edges: Ints, points: Floats) -> Ints:
    """Find the path along edges that follows a polyline.

    An edge counts longer the further its midpoint is from the polyline, so that the path stays close to it on any mesh.

    Parameters
    ----------
    where : str
        Key of the scene, for messages.
    positions : (n, 3) float64
        Vertices [m].
    edges : (e, 2) int64
        Edges that the path may use.
    points : (p, 3) float64
        Polyline [m]; each point is moved to the nearest vertex of an edge.

    Returns
    -------
    (k,) int64
        Vertices of the path, in order.

    Raises
    ------
    InputError
        Where there are fewer than two points, one is further from the mesh than an edge is long, or no path joins two.
    """
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


def _nearest(where: str, positions: Floats, vertices: Ints, points: Floats, limit: float) -> Ints:
    """The one of `vertices` nearest to each point, (p,)."""
    distances = np.linalg.norm(positions[vertices] - points[:, None], axis=2)
    distant = np.flatnonzero(distances.min(axis=1) > limit)
    if distant.size:
        raise InputError(
            f"{where}[{distant[0]}] is {distances[distant[0]].min():.3g} m from the mesh at rest.",
            "Draw the line in the coordinates of the mesh before it is placed.",
        )
    return vertices[distances.argmin(axis=1)]


def _distance_to_segment(points: Floats, start: Floats, end: Floats) -> Floats:
    """Distance of each of `points (n, 3)` from the segment, (n,) [m]."""
    along = end - start
    squared = float(along @ along)
    along_segment = np.clip((points - start) @ along / squared, 0.0, 1.0) if squared else np.zeros(len(points))
    return np.asarray(np.linalg.norm(points - start - along_segment[:, None] * along, axis=1), np.float64)


def _back(where: str, before: Ints, first: int, last: int) -> Ints:
    """Path to `last` from the predecessor of each vertex, without `first`."""
    path = []
    while last != first:
        if last < 0:
            raise InputError(f"{where}: no path along the edges joins one point to the next.")
        path.append(last)
        last = int(before[last])
    return np.array(path[::-1], np.int64)
