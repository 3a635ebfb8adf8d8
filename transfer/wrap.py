"""Wrap of garments on a body: one closed surface at a distance from them, and round the body where they end.

The wrap is the level set d = c of the distance d to the garments, negative in the space that they enclose: where the
magnitude of the winding number is above one half, so that the space under a skirt or a loose shirt is filled up to its
openings (Jacobson, Kavan & Sorkine-Hornung 2013). The body itself is added up to a few cells from them, so that their
hems are not the edges of a thin sheet. Marching cubes on a lattice, evaluated near the surface alone. A level set has
an error of the order of the curvature times the square of a cell, and sees no sheet thinner than a cell: whether it
holds what it should is for the caller to test.

Without garments it is the level set of the body; without distance the union of its pieces, with holes closed. Gaps
between pieces, as at the joints of a jointed figure, are bridged by a morphological closing: out by a distance, and
back by the same.
"""

from collections.abc import Sequence

import igl
import numpy as np

from transfer.errors import TransferError
from transfer.signed_distance import BodySurface, body_surface
from transfer.triangle_surface import Floats, Ints, adjacency, edges_of, largest_component, vertex_components

COARSE = 4
"""Cells of the lattice along a side of those by which the surface is found first."""
REACH = 3
"""Cells from the garments up to which the body is part of their wrap."""
FLAT = 0.1
"""Least magnitude of d - c at a node, as a fraction of a cell: below, triangles would be slivers."""

CLOSINGS = (0.0, 1.0, 2.0)
"""Distances by which a union is closed, in cells, in the order in which they are tried."""
CRUMBS = 0.01
"""Largest area of parts of a union that are left out, as a fraction of the whole: a fragment of a scan."""
ROUNDINGS = (0.5, -0.53, 0.5, -0.53)
"""Steps of the vertices of a union towards the means of their neighbours and back, which widen the slivers of marching
cubes and keep the volume (Taubin 1995)."""

TriangleMesh = tuple[Floats, Ints]
"""Vertices (n, 3) [m] and triangles (m, 3) of a garment."""


def wrap(surface: BodySurface, garments: Sequence[TriangleMesh], layer: float, cell: float) -> TriangleMesh:
    """The closed surface round garments on a body, outward; it may have several pieces, none of them a cavity.

    Parameters
    ----------
    surface : BodySurface
        The body, in any number of pieces that may overlap.
    garments : sequence of TriangleMesh
        Open surfaces on it; none for the level set of the body.
    layer, cell : float
        Distance from them, and side of a lattice cell [m].

    Returns
    -------
    TriangleMesh
        Vertices (n, 3) [m] and triangles (m, 3).
    """
    every = np.concatenate([positions for positions, _ in garments] or [surface.positions])
    room = layer + 2 * COARSE * cell
    low, high = every.min(axis=0) - room, every.max(axis=0) + room
    blocks = np.ceil((high - low) / (COARSE * cell)).astype(np.int64)
    shape = COARSE * blocks + 1
    shells = [_Shell(*garment) for garment in garments]

    def level(points: Floats) -> Floats:
        """Distance of points (k, 3) less that of the wrap, (k,) [m]."""
        body = surface.closest(points).signed_distance
        if not shells:
            return np.asarray(body - layer, np.float64)
        garment = np.min([shell.distance(points) for shell in shells], axis=0)
        return np.asarray(np.minimum(garment - layer, np.maximum(body, garment - REACH * cell)), np.float64)

    middles = low + COARSE * cell * (np.argwhere(np.ones(blocks, bool)) + 0.5)
    coarse = level(middles).reshape(blocks)
    near = np.abs(coarse) <= np.sqrt(3) / 2 * COARSE * cell
    values = np.pad(coarse.repeat(COARSE, 0).repeat(COARSE, 1).repeat(COARSE, 2), [(0, 1)] * 3, mode="edge")
    chosen = np.zeros(shape, bool)
    for block in np.argwhere(near) * COARSE:
        chosen[tuple(slice(start, start + COARSE + 1) for start in block)] = True
    rows = np.argwhere(chosen)
    values[chosen] = level(low + cell * rows)
    values = np.where(np.abs(values) < FLAT * cell, np.copysign(FLAT * cell, values), values)

    nodes = low + cell * np.argwhere(np.ones(shape[::-1], bool))[:, ::-1]
    positions, triangles, _ = igl.marching_cubes(values.ravel(order="F"), nodes, *(int(n) for n in shape), 0.0)
    x, faces = np.asarray(positions, np.float64), np.asarray(triangles, np.int64)
    if not len(faces):
        return x, faces
    # the pieces that are not cavities, turned outward
    label = vertex_components(faces, len(x))[faces[:, 0]]
    corners = x[faces]
    volume = np.bincount(label, np.einsum("ti,ti->t", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])))
    sign = np.sign(volume[np.argmax(np.abs(volume))])
    x, faces = _only(x, faces[(sign * volume > 0)[label]])
    return x, faces if sign > 0 else faces[:, [0, 2, 1]]


def union(surface: BodySurface, cell: float) -> TriangleMesh:
    """The outside of a body in pieces as one closed surface, outward.

    Parameters
    ----------
    surface : BodySurface
        The body, whose pieces may overlap, be open, or leave gaps of up to four cells.
    cell : float
        Side of a lattice cell [m].

    Returns
    -------
    TriangleMesh
        Vertices (n, 3) [m] and triangles (m, 3).

    Raises
    ------
    TransferError
        The pieces are further apart.

    Examples
    --------
    >>> import numpy as np
    >>> from transfer.signed_distance import body_surface
    >>> cube = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    >>> faces = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]]
    >>> faces = np.array([*faces, [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]])
    >>> two = body_surface(np.concatenate([cube, cube + [0.9, 0.1, 0.1]]), np.concatenate([faces, faces + 8]))
    >>> np.ptp(union(two, 0.1)[0], axis=0).round(1).tolist()
    [1.9, 1.1, 1.1]
    """
    parts: Floats = np.zeros(0)
    for closing in CLOSINGS:
        made = wrap(surface, [], closing * cell, cell)
        if closing and len(made[1]):
            made = wrap(body_surface(*made), [], -closing * cell, cell)
        positions, triangles = made
        if not len(triangles):
            continue
        label = vertex_components(triangles, len(positions))
        own = label[triangles[:, 0]]
        parts = np.sort(np.bincount(own))[::-1] / len(own)  # all triangles have about the same area
        if (parts[1:] < CRUMBS).all():
            positions, triangles = _only(positions, triangles[own == largest_component(triangles, label)])
            ring = adjacency(edges_of(triangles), len(positions))
            count = ring.sum(axis=1)[:, None]
            for step in ROUNDINGS:
                positions = positions + step * ((ring @ positions) / count - positions)
            return positions, triangles
    if not len(parts):
        raise TransferError("The body is thinner than a cell of the lattice on which it is wrapped.")
    raise TransferError(
        f"The pieces of the body are more than {4e3 * cell:.3g} mm apart: wrapped in one surface they are still "
        f"{np.count_nonzero(parts >= CRUMBS)} parts, the largest with {100 * parts[0]:.0f} % of the area."
    )


def _only(positions: Floats, triangles: Ints) -> TriangleMesh:
    """The vertices of some triangles, renumbered."""
    used, renumbered = np.unique(triangles, return_inverse=True)
    return positions[used], renumbered.reshape(-1, 3).astype(np.int64)


class _Shell:
    """Garment with its search tree; `distance` is negative in the space that it encloses."""

    def __init__(self, positions: Floats, triangles: Ints) -> None:
        self._mesh = np.ascontiguousarray(positions), np.ascontiguousarray(triangles)
        self._tree = igl.AABB()
        self._tree.init(*self._mesh)

    def distance(self, points: Floats) -> Floats:
        """Distance of points (k, 3) [m]."""
        squared = self._tree.squared_distance(*self._mesh, points)[0].ravel()
        inside = np.abs(np.asarray(igl.fast_winding_number(*self._mesh, points)).ravel()) > 0.5
        return np.asarray(np.where(inside, -1.0, 1.0) * np.sqrt(squared), np.float64)
