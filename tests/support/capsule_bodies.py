"""Test bodies: smooth unions of capsules, meshed at any cell size, so that two have different topology."""

import numpy as np

from transfer.triangle_surface import adjacency, edges_of


def capsules(leg_spread, arm_drop, girth):
    """End points (k, 2, 3) and radii (k,) of trunk, head, arms and legs, standing on y = 0, 1.7 high."""
    ends, radii = [[(0, 0.9, 0), (0, 1.35, 0)], [(0, 1.45, 0), (0, 1.6, 0)]], [0.13 * girth, 0.09]
    for side in (-1, 1):
        ends += [[(0, 1.3, 0), (side * 0.65, 1.3 - arm_drop, 0)], [(0, 0.85, 0), (side * leg_spread, 0.07, 0)]]
        radii += [0.06 * girth, 0.08 * girth]
    return np.array(ends, dtype=float), np.array(radii)


def person(cell, leg_spread=0.25, arm_drop=0.3, girth=1.0, blend=0.03):
    """A closed person [m], y up: positions (n, 3), triangles (m, 3) with edges of about `cell` [m]."""
    import igl

    ends, radii = capsules(leg_spread, arm_drop, girth)
    axes = [np.arange(low, high, cell) for low, high in ((-0.85, 0.85), (-0.1, 1.8), (-0.25, 0.25))]
    z, y, x = np.meshgrid(*axes[::-1], indexing="ij")
    points = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    total = np.zeros(len(points))
    for (a, b), radius in zip(ends, radii, strict=True):
        along = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
        total += np.exp(-(np.linalg.norm(points - a - along[:, None] * (b - a), axis=1) - radius) / blend)
    distance = -blend * np.log(np.maximum(total, 1e-300))
    positions, triangles, _ = igl.marching_cubes(distance, points, *(len(axis) for axis in axes), 0.0)
    triangles = np.ascontiguousarray(triangles, dtype=np.int64)
    if signed_volume(positions, triangles) < 0:
        triangles = np.ascontiguousarray(triangles[:, ::-1])
    ring = adjacency(edges_of(triangles), len(positions))
    for _ in range(4):  # marching cubes leaves slivers
        positions = (positions + (ring @ positions) / ring.sum(axis=1)[:, None]) / 2
    return positions, triangles


def signed_volume(positions, triangles):
    """Positive where the triangles wind outward."""
    a, b, c = (positions[triangles[:, k]] for k in range(3))
    return np.einsum("ta,ta->", a, np.cross(b, c)) / 6
