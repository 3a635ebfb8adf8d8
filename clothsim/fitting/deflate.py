"""A body made thinner, so that it is clear of a garment that was inside it: the guaranteed path grows it back.

Each vertex moves inward along its normal by the depth, but never further than KEPT of the way to the middle of the body
below it. A vertex comes back on the same straight line: a moving obstacle that only ever moves outward.
"""

import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.mesh.topology import vertex_rings
from transfer.signed_distance import SKIN, BodySurface

KEPT = 0.9
"""The share of the half thickness that a vertex may move: what is left keeps its two sides apart."""
SMOOTHINGS = 8
"""Rounds that even out thickness and normals over their neighbours: ears and fingers have wild ones."""
RAYS, OPENING = 7, np.radians(20.0)
"""The rays that measure the thickness below a vertex, and how far from its normal all but one are [rad]."""


def half_thickness(body: BodySurface) -> Floats:
    """Half of the way through the body below each vertex [m], (n,): the median over a cone of rays, then evened out."""
    ways = []
    for directions in _cone(-body.vertex_normals):
        distance, _ = body.exits(body.positions + 10 * SKIN * body.size * directions, directions)
        ways.append(np.where(np.isfinite(distance), distance, 0.0))  # nothing below: the rim of an open body stays
    return smoothed(0.5 * np.median(ways, axis=0), body.triangles)


def deflated(body: BodySurface, depth: float, half: Floats) -> Floats:
    """The body's vertices `depth` [m] further inside, (n, 3); half: its `half_thickness`."""
    normals = np.column_stack([smoothed(body.vertex_normals[:, axis], body.triangles) for axis in range(3)])
    return body.positions - np.minimum(depth, KEPT * half)[:, None] * _unit(normals)


def smoothed(values: Floats, triangles: Ints) -> Floats:
    """Each value, SMOOTHINGS times half its own and half the mean of its neighbours', (n,)."""
    starts, neighbours = vertex_rings(triangles, len(values))
    count = np.diff(starts)
    owner = np.repeat(np.arange(len(values)), count)
    for _ in range(SMOOTHINGS):
        mean = np.bincount(owner, values[neighbours], minlength=len(values)) / np.maximum(count, 1)
        values = np.where(count > 0, 0.5 * (values + mean), values)
    return values


def _cone(directions: Floats) -> list[Floats]:
    """`directions (n, 3)`, and RAYS - 1 evenly around each."""
    steepest = np.eye(3)[np.argmin(np.abs(directions), axis=1)]
    side = _unit(np.cross(directions, steepest))
    other = np.cross(directions, side)
    around = 2 * np.pi * np.arange(RAYS - 1) / (RAYS - 1)
    tilted = [directions + np.tan(OPENING) * (np.cos(a) * side + np.sin(a) * other) for a in around]
    return [_unit(ray) for ray in (directions, *tilted)]


def _unit(vectors: Floats) -> Floats:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors / np.where(length > 0, length, 1.0)
