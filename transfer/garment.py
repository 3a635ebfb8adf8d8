"""A garment goes along when its body becomes another one (deformation transfer, with a body as the source).

Each garment triangle takes the mean S of the body triangles that it lies over, weighted by distance so that neighbours
do not jump; and each vertex is anchored, softly, where these carry it, so that the sum of the S does not drift away
from the body. Nothing here keeps cloth out of the body: a repair has to follow.
"""

import numpy as np
from numpy.typing import ArrayLike

from transfer.adjacency import vertex_components
from transfer.deform import DeformationTransfer, deformation_transfer
from transfer.errors import TransferError
from transfer.gradients import centroids, mean_edge, without_area
from transfer.triangle_surface import Floats, Ints, as_surface, triangle_normals

FOLLOWED, CANDIDATES = 16, 64
"""Body triangles that a garment triangle follows, at most, out of the nearest that are looked at."""
FAINTEST = 1e-6
"""A body triangle with a weight below this is left out."""
REACH = 0.05
"""Of the body's longest side: over this length the gradients shape the garment, beyond it the anchors place it. A
tenth of a metre on a person; .02 to .3 m were tried: longer ones drift, shorter ones print the body into the cloth."""


def transfer_garment(
    garment_positions: ArrayLike,
    garment_triangles: ArrayLike,
    source_body: ArrayLike,
    target_body: ArrayLike,
    body_triangles: ArrayLike,
) -> Floats:
    """The garment (n, 3), which lies on `source_body` (k, 3), as it lies on `target_body` (k, 3).

    Both bodies share `body_triangles` (m, 3): bodies of other topology go through `correspond` first, whose
    `positions` are the source body in the target's shape. Vertices may end up inside the body. TransferError for bad
    arrays and for garment triangles without area.
    """
    follower = garment_transfer(garment_positions, garment_triangles, source_body, body_triangles)
    return follower.pose(source_body, body_triangles, target_body)


def garment_transfer(
    garment_positions: ArrayLike, garment_triangles: ArrayLike, body_positions: ArrayLike, body_triangles: ArrayLike
) -> DeformationTransfer:
    """The garment on its body, factorised once: `.pose(body, body_triangles, other body)` for each body or pose."""
    garment = as_surface("garment", garment_positions, garment_triangles)
    body = as_surface("body", body_positions, body_triangles)
    pairs, weights = followed(garment, body)
    length = REACH * float(np.ptp(body[0][np.unique(body[1])], axis=0).max())
    return deformation_transfer(*garment, pairs, weights, anchor=2.0 / length**2)


def followed(garment: tuple[Floats, Ints], body: tuple[Floats, Ints]) -> tuple[Ints, Floats]:
    """Pairs (p, 2): (body triangle, garment triangle), and weights (p,) of sum 1 for each garment triangle.

    Of the nearest body triangles those count that face as the garment's does (each piece of the garment may be wound
    either way), or all where none does; weights exp(-(d^2 - d_0^2) / h^2), d_0 the nearest distance and
    h = max(d_0, mean edge of the body): the farther the cloth, the broader its mean.
    """
    from scipy.spatial import cKDTree

    sound = np.flatnonzero(~without_area(*body))
    if len(sound) == 0:
        raise TransferError("the body has no triangle with an area.", "Give a surface.")
    over = body[0], body[1][sound]
    count = min(CANDIDATES, len(sound))
    distance, near = cKDTree(centroids(*over)).query(centroids(*garment), k=np.arange(1, count + 1))
    facing = np.einsum("ta,tka->tk", outward(garment, over, near[:, 0]), triangle_normals(*over)[near]) > 0
    facing[~facing.any(axis=1)] = True
    distance = np.where(facing, distance, np.inf)
    order = np.argsort(distance, axis=1, kind="stable")[:, :FOLLOWED]
    distance, near = np.take_along_axis(distance, order, axis=1), np.take_along_axis(near, order, axis=1)
    nearest = distance[:, :1]
    weights = np.exp((nearest**2 - distance**2) / np.maximum(nearest, mean_edge(*over)) ** 2)
    kept = weights > FAINTEST
    rows = np.broadcast_to(np.arange(len(near))[:, None], near.shape)[kept]
    sums = np.bincount(rows, weights[kept])
    return np.column_stack([sound[near[kept]], rows]), weights[kept] / sums[rows]


def outward(garment: tuple[Floats, Ints], body: tuple[Floats, Ints], nearest: Ints) -> Floats:
    """The garment's normals (t, 3), turned piece by piece to where most of the nearest body triangles face."""
    normals = triangle_normals(*garment)
    piece = vertex_components(garment[1], len(garment[0]))[garment[1][:, 0]]
    agreement = np.bincount(piece, np.einsum("ta,ta->t", normals, triangle_normals(*body)[nearest]))
    return np.where(agreement[piece] < 0, -1.0, 1.0)[:, None] * normals
