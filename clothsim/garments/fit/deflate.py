"""Deflation of a body until it is clear of a garment; the guaranteed path inflates it again.

Each vertex moves inward along its normal by the depth, but at most by LARGEST_FRACTION of the half thickness of the
body below it. It returns along the same straight line: a moving obstacle that only moves outward.
"""

import numpy as np
from scipy.sparse import csr_array

from clothsim.base.arrays import Floats, Ints
from clothsim.engine import vertex_rings
from transfer.signed_distance import SKIN, BodySurface

LARGEST_FRACTION = 0.9
"""Largest displacement as a fraction of the half thickness: the rest keeps the two surfaces apart."""
SMOOTHINGS = 8
"""Smoothing iterations of thickness and normals, which vary strongly at ears and fingers."""
RAYS, OPENING = 7, np.radians(20.0)
"""Rays that measure the thickness below a vertex, and angle of all but one to its normal [rad]."""


def half_thickness(body: BodySurface) -> Floats:
    """Half thickness of the body below each vertex, (n,) [m]: median over a cone of rays, then smoothed."""
    thicknesses = []
    for directions in _cone(-body.vertex_normals):
        distance, _ = body.exits(body.positions + 10 * SKIN * body.size * directions, directions)
        thicknesses.append(np.where(np.isfinite(distance), distance, 0.0))  # no hit: the rim of an open body stays
    return smoothed(0.5 * np.median(thicknesses, axis=0), body.triangles)


def outward_normals(body: BodySurface) -> Floats:
    """Smoothed unit normals of the body, (n, 3), along which it is deflated."""
    return _unit(smoothed(body.vertex_normals, body.triangles))


def deflated(body: BodySurface, depth: float, half: Floats, normals: Floats) -> Floats:
    """Body vertices moved inward by `depth` [m], (n, 3) [m].

    half (n,): its `half_thickness` [m]; normals (n, 3): its `outward_normals`.
    """
    return np.asarray(body.positions - np.minimum(depth, LARGEST_FRACTION * half)[:, None] * normals, np.float64)


def smoothed(values: Floats, triangles: Ints) -> Floats:
    """Values (n,) or (n, k) after SMOOTHINGS averages with the mean of their neighbours."""
    starts, neighbours = vertex_rings(triangles, len(values))
    count = np.diff(starts)
    owner = np.repeat(np.arange(len(values)), count)
    weights = csr_array((1.0 / count[owner], (owner, neighbours)), shape=(len(values), len(values)))
    alone = count == 0
    for _ in range(SMOOTHINGS):
        means = weights @ values
        means[alone] = values[alone]
        values = 0.5 * (values + means)
    return values


def _cone(directions: Floats) -> list[Floats]:
    """`directions (n, 3)`, and RAYS - 1 evenly around each."""
    steepest = np.eye(3)[np.argmin(np.abs(directions), axis=1)]
    side = _unit(np.cross(directions, steepest))
    other = np.cross(directions, side)
    angles = 2 * np.pi * np.arange(RAYS - 1) / (RAYS - 1)
    tilted = [directions + np.tan(OPENING) * (np.cos(a) * side + np.sin(a) * other) for a in angles]
    return [_unit(ray) for ray in (directions, *tilted)]


def _unit(vectors: Floats) -> Floats:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors / np.where(length > 0, length, 1.0)
