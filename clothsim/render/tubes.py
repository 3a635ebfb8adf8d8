"""Tubes round centre lines, as which rods are drawn."""

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.linalg import unit

AROUND = 10
"""Corners of the section of a tube."""


def tube(points: Floats, is_loop: bool, radius: float) -> tuple[Floats, Ints]:
    """Positions and triangles of a tube round points (n, 3) in order [m], facing outward; its ends are open.

    Examples
    --------
    >>> positions, triangles = tube(np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]]), False, 0.1)
    >>> positions.shape, triangles.shape, round(float(np.abs(positions[:, 1]).max()), 3)
    ((30, 3), (40, 3), 0.1)
    """
    n = len(points)
    edges = unit(np.diff(np.concatenate([points, points[:1]]) if is_loop else points, axis=0))
    before = np.concatenate([edges[-1:] if is_loop else edges[:1], edges])[:n]
    tangents = unit(before + np.concatenate([edges, edges[-1:]])[:n])
    across = np.eye(3)[np.abs(tangents[0]).argmin()]
    first = np.empty((n, 3))
    for k, tangent in enumerate(tangents):  # carried along the line with as little twist as can be
        across = unit(across - (across @ tangent) * tangent)
        first[k] = across
    second = np.cross(tangents, first)
    angles = 2 * np.pi * np.arange(AROUND) / AROUND
    rings = np.cos(angles)[:, None] * first[:, None] + np.sin(angles)[:, None] * second[:, None]
    positions = (points[:, None] + radius * rings).reshape(-1, 3)
    here = AROUND * np.arange(n)
    there = np.roll(here, -1) if is_loop else here[1:]
    here = here[: len(there), None]
    side, after = np.arange(AROUND), np.roll(np.arange(AROUND), -1)
    a, b, c, d = here + side, here + after, there[:, None] + side, there[:, None] + after
    if is_loop:  # the frame does not close: the last ring meets the nearest turn of the first
        turn = int(np.round(np.arctan2(second[-1] @ first[0], first[-1] @ first[0]) / (2 * np.pi / AROUND))) % AROUND
        c[-1], d[-1] = (side - turn) % AROUND, (after - turn) % AROUND
    triangles = np.concatenate([np.stack([a, b, d], axis=2), np.stack([a, d, c], axis=2)]).reshape(-1, 3)
    return positions, triangles.astype(np.int64)
