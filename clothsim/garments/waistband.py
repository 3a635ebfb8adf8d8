"""Waistbands: upper borders about the trunk of what hangs from the hips, closed to the girth of the body below them.

A garment keeps its ease where it is graded, and one with ease at its upper border slides: nothing but that border holds
a skirt. A pattern maker cuts a band a little shorter than the girth that it lies on.
"""

from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from clothsim.base.arrays import Floats, Ints
from clothsim.engine import border_edges, components
from clothsim.garments.inputs import BodyMesh
from transfer.body_frame import girth, level_set, loops
from transfer.body_parts import BodyParts

TIGHT = 0.95
"""Length of a band over the girth of the body below it."""
LEAST = 0.75
"""A border that would be shortened by more stands off on purpose, and is left as it is."""
TOP = 0.01
"""Height to which a piece reaches above its band, as a fraction of the body's: with more it has shoulders or straps."""
DEPTH = 0.04
"""Depth below the band in which the garment narrows to it, as a fraction of the body's height."""


class Banded(NamedTuple):
    """Rest shape (n, 3) [m] with its bands closed, and the length of each band over the one that it had."""

    rest: Floats
    factors: tuple[float, ...]


class Band(NamedTuple):
    """Directed border edges (b, 2), vertices (k,) of its piece, centre (3,) and girth [m] of the body at its height.

    The centre is in the frame of the body.
    """

    edges: Ints
    piece: Ints
    centre: Floats
    girth: float


def with_waistbands(positions: Floats, triangles: Ints, body: BodyMesh, parts: BodyParts) -> Banded:
    """Close the waistbands of a garment at `positions` (n, 3) [m] on a body and its parts."""
    local = parts.frame.local(positions)
    rest, factors = local.copy(), []
    for band in bands(local, triangles, body, parts):
        length = float(np.linalg.norm(np.diff(local[band.edges], axis=1), axis=2).sum())
        factor = TIGHT * band.girth / length
        if not LEAST <= factor < 1.0:
            continue
        scale = 1.0 + (factor - 1.0) * nearness(local, band, parts)
        for axis in (0, 2):
            rest[band.piece, axis] = band.centre[axis] + scale * (local[band.piece, axis] - band.centre[axis])
        factors.append(factor)
    return Banded(parts.frame.world(rest) if factors else positions, tuple(factors))


def bands(local: Floats, triangles: Ints, body: BodyMesh, parts: BodyParts) -> list[Band]:
    """Topmost borders about the trunk, between crotch and armpits, of a garment at `local` (n, 3) [m]."""
    found = []
    on_body = parts.frame.local(body.positions)
    pieces = components(triangles, len(local))
    for edges in border_loops(triangles):
        loop = np.unique(edges)
        piece = np.flatnonzero(pieces == pieces[loop[0]])
        height = float(local[loop, 1].mean())
        low, high = parts.landmarks["crotch"], parts.landmarks["armpit"]
        topmost = local[piece, 1].max() <= local[loop, 1].max() + TOP * parts.frame.height
        centre = parts.trunk.at(np.array([height]), parts.trunk.centres)[0]
        centre[1] = height
        if topmost and low < height < high and abs(turns_about(local[edges] - centre)) > 0.5:
            found.append(Band(edges, piece, centre, girth_at(on_body, body.triangles, centre)))
    return found


def nearness(local: Floats, band: Band, parts: BodyParts) -> Floats:
    """Smooth weight of each vertex of the piece of a band, 1 at the band and 0 from DEPTH on, (k,)."""
    nearest = cKDTree(local[np.unique(band.edges)]).query(local[band.piece])[0]
    distance = np.minimum(nearest / (DEPTH * parts.frame.height), 1.0)
    return np.asarray(1.0 - distance**2 * (3.0 - 2.0 * distance), np.float64)


def girth_at(local: Floats, triangles: Ints, centre: Floats) -> float:
    """Girth [m] of the piece nearest to `centre` (3,) of a level section of a body, vertices `local` (n, 3)."""
    sections = loops(level_set(local, triangles, local[:, 1], float(centre[1])), triangles)
    near = min(sections, key=lambda one: float(np.linalg.norm(one.centre - centre)))
    return girth(near)


def border_loops(triangles: Ints) -> list[Ints]:
    """Directed border edges (b, 2) of each connected piece of the border."""
    edges = border_edges(triangles)[0]
    if not len(edges):
        return []
    n = int(triangles.max()) + 1
    graph = coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(n, n))
    labels = connected_components(graph, directed=False)[1][edges[:, 0]]
    return [edges[labels == label] for label in np.unique(labels)]


def turns_about(edges: Floats) -> float:
    """Turns of directed edges (b, 2, 3) about the second axis through the origin."""
    angles = np.arctan2(edges[:, :, 2], edges[:, :, 0])
    return float(((np.diff(angles, axis=1) + np.pi) % (2.0 * np.pi) - np.pi).sum() / (2.0 * np.pi))
