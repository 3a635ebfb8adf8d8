"""Parts of bodies at a pinch: the carrier of each vertex, and the patch of the body that is its own."""

import numpy as np
from scipy.spatial import cKDTree

from clothsim.base.arrays import Floats, Ints
from clothsim.mesh.world import World
from clothsim.solve.pinch.carried import Carried, attached, normals
from clothsim.solve.pinch.pinch_gaps import Sides

SAME_PINCH = 4.0
"""Distance within which a vertex is carried by the part that carries its neighbour, in median cloth edges."""
MUCH_MORE = 1.5
"""Ratio of the displacements of two parts in a step from which on they are not alike."""
OWN_PATCH = 2.5
"""Radius of the patch about a carrier with which contact goes on, in longest cloth edges."""
FACES_AWAY = -0.3
"""Cosine of the normals from which on a triangle does not belong to the patch of a carrier."""


def median_and_longest_edge(world: World, x: Floats) -> tuple[float, float]:
    """Median and largest length of the cloth edges at x [m]."""
    lengths = np.linalg.norm(x[world.edges[:, 1]] - x[world.edges[:, 0]], axis=1)
    return float(np.median(lengths)), float(lengths.max())


def with_carriers(world: World, x: Floats, end: Floats, found: Sides, known: Carried) -> Carried:
    """Carry the vertices of a pinch from where they are.

    The vertex in the narrowest gap is carried by the part that moves less against the whole cloth, of two alike by the
    one that it is closer to, and those about it by the same part: cloth that two parts carried would be torn where they
    slide along one another.

    Parameters
    ----------
    world : World
        Meshes.
    x, end : (N, 3) array
        At the start of the step, and as it would end: the bodies there, the cloth with its velocity [m].
    found : Sides
        The pinch, without vertices of `known`.
    known : Carried
        Carried already.
    """
    if not len(found.vertices):
        return known
    near, far = normals(x, found.near), normals(x, found.far)
    at, reach = x[found.vertices], SAME_PINCH * median_and_longest_edge(world, x)[0]
    distance, along = np.full(len(at), np.inf), near.copy()
    if len(known):
        distance, nearest = cKDTree(x[known.vertices]).query(at)
        along = normals(x, known.triangles)[nearest]
    takes_near, left = _moves_less(world, end - x, found), np.ones(len(at), bool)
    for _ in range(len(at)):
        rank = np.where(left, distance, np.inf)
        k = int(rank.argmin())
        if not rank[k] <= reach:
            k = int(np.where(left, found.gaps, np.inf).argmin())
        else:
            takes_near[k] = near[k] @ along[k] >= far[k] @ along[k]
        left[k] = False
        normal = near[k] if takes_near[k] else far[k]
        closer = np.linalg.norm(at - at[k], axis=1)
        distance, along = (
            np.where(closer < distance, closer, distance),
            np.where((closer < distance)[:, None], normal, along),
        )
    takes = takes_near[:, None]
    carrier = np.where(takes, found.near, found.far), np.where(takes, found.near_weights, found.far_weights)
    other = np.where(takes, found.far, found.near), np.where(takes, found.far_weights, found.near_weights)
    return known.joined(attached(x, found.vertices, carrier, other))


def _moves_less(world: World, moves: Floats, found: Sides) -> np.ndarray:
    """Mask (k,) of the vertices whose nearer part moves less against the cloth than the other, or about as much."""
    common = moves[: world.n_cloth].mean(axis=0)
    parts = (found.near, found.near_weights), (found.far, found.far_weights)
    near, far = (np.linalg.norm(np.einsum("kc,kcd->kd", w, moves[rows]) - common, axis=1) for rows, w in parts)
    return np.asarray(near <= MUCH_MORE * far)


def own_rows(world: World, x: Floats, carried: Carried) -> Ints:
    """Sorted keys v N + q of the body rows q of the patch about the carrier of each carried row v.

    The patch grows from the triangle over common edges, as far as OWN_PATCH and while the normals do not face away.
    """
    triangles = world.body_triangles
    unit, centres = normals(x, triangles), x[triangles].mean(axis=1)
    radii = np.linalg.norm(x[triangles] - centres[:, None], axis=2).max(axis=1)
    radius = OWN_PATCH * median_and_longest_edge(world, x)[1]
    starts = _faces(triangles, carried.triangles, len(x))
    points, across = carried.points(x), _adjacent(triangles, len(x))
    seen = front = np.arange(len(carried)) * len(triangles) + starts
    while len(front):
        of, face = np.repeat(front // len(triangles), 3), across[front % len(triangles)].ravel()
        of, face = of[face >= 0], face[face >= 0]
        closer = np.linalg.norm(centres[face] - points[of], axis=1) - radii[face] <= radius
        ahead = np.einsum("kd,kd->k", unit[face], unit[starts[of]]) > FACES_AWAY
        keys = (of * len(triangles) + face)[closer & ahead]
        front = np.setdiff1d(keys, seen)
        seen = np.union1d(seen, front)
    rows = triangles[seen % len(triangles)]
    return np.unique(carried.vertices[seen // len(triangles)][:, None] * len(x) + rows)


def _faces(triangles: Ints, wanted: Ints, size: int) -> Ints:
    """Indices of the `wanted` (k, 3) among the triangles (m, 3), whose rows are below `size`."""
    keys, sought = ((each[:, 0] * size + each[:, 1]) * size + each[:, 2] for each in (triangles, wanted))
    order = np.argsort(keys)
    return np.asarray(order[np.searchsorted(keys[order], sought)])


def _adjacent(triangles: Ints, size: int) -> Ints:
    """Triangle across each edge, (m, 3); -1 at a border, and where more than two meet."""
    edges = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    keys = edges[:, 0] * size + edges[:, 1]
    order = np.argsort(keys, kind="stable")
    _, first, counts = np.unique(keys[order], return_index=True, return_counts=True)
    pairs = first[counts == 2]
    across = np.full(len(keys), -1)
    across[order[pairs]], across[order[pairs + 1]] = order[pairs + 1] // 3, order[pairs] // 3
    return across.reshape(-1, 3)
