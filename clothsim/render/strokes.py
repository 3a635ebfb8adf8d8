"""Principal directions as crosses of two short strokes on the cloth."""

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.linalg import unit

INK = np.array([0.13, 0.13, 0.16])
ACROSS = 22
"""So many crosses stand side by side along the longest side of the cloths, fewer where the triangles are larger."""

HALF_LENGTH, WIDTHS, LIFT = 0.42, (0.11, 0.055), 0.04
"""Half a stroke of stretch 1, the widths of the two strokes and their height over the cloth, in distances of crosses.

The stroke of the larger stretch is the wider one."""


def spacing_of(positions: Floats, triangles: Ints) -> float:
    """Distance between crosses on cloths with vertices (n, 3) and triangles (m, 3) [m]."""
    a, b, c = (positions[triangles[:, k]] for k in range(3))
    areas = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return float(max(np.ptp(positions, axis=0).max() / ACROSS, np.sqrt(np.median(areas))))


def evenly_spaced(centres: Floats, spacing: float) -> Ints:
    """Numbers of points, ascending: of `centres (m, 3)` the nearest to the middle of each cell of a grid [m]."""
    cells = np.floor((centres - centres.min(axis=0)) / spacing)
    off_centre = np.linalg.norm((centres - centres.min(axis=0)) / spacing - cells - 0.5, axis=1)
    order = np.lexsort([off_centre, *cells.T])
    first = np.concatenate([[True], (np.diff(cells[order], axis=0) != 0).any(axis=1)])
    return np.sort(order[first])


def crosses(centres: Floats, directions: Floats, stretches: Floats, spacing: float) -> Floats:
    """Two strokes at each of `centres (k, 3)`, their ends (k, 2, 2, 3) [m]: by cross, by stroke, from and to.

    directions: (k, 3, 2) unit columns; stretches: (k, 2), the lengths of the strokes in units of one of stretch 1.
    """
    half = HALF_LENGTH * spacing * np.swapaxes(directions, 1, 2) * stretches[:, :, None]
    return centres[:, None, None, :] + np.stack([-half, half], axis=2)


def ribbons(strokes: Floats, spacing: float) -> tuple[Floats, Floats]:
    """Thin rectangles over both sides of the cloth along strokes (k, 2, 2, 3): corners and normals (8 k, 3, 3)."""
    along = strokes[:, :, 1] - strokes[:, :, 0]
    normals = unit(np.cross(along[:, 0], along[:, 1]))[:, None, :]
    aside = 0.5 * spacing * np.array(WIDTHS)[None, :, None] * unit(np.cross(normals, along))
    corners, facing = [], []
    for side in (LIFT * spacing, -LIFT * spacing):
        start, end = (strokes[:, :, k] + side * normals for k in (0, 1))
        quads = np.stack([start - aside, end - aside, end + aside, start + aside], axis=2).reshape(-1, 4, 3)
        corners += [quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]
        outward = np.broadcast_to(np.sign(side) * normals, along.shape).reshape(-1, 1, 3)
        facing += 2 * [np.broadcast_to(outward, (len(quads), 3, 3))]
    return np.concatenate(corners), np.concatenate(facing)
