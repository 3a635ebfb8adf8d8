"""Markers of the user: corresponding points of the source and the target body."""

from pathlib import Path

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.base.safe_files.regular_file import read_regular_file
from clothsim.garments.inputs import Figure

NO_MARKERS = np.zeros((0, 6))
"""No markers: they are derived from the shapes of the bodies."""
FARTHEST = 0.05
"""Largest distance of a marker from the nearest vertex of its body [m]."""
HOW = "Give six numbers a line, in the units of the files: x y z on the garment's own body, x y z on the other."


def read_markers(path: str | Path) -> Floats:
    """The lines of a text file, (k, 6), k > 0: six numbers each; # begins a comment. InputError names the line."""
    rows = []
    try:
        lines = read_regular_file(path).decode("utf-8").splitlines()
    except (FileNotFoundError, UnicodeDecodeError) as error:
        raise InputError(f"The markers in {path} cannot be read: {error}.", HOW) from error
    for number, line in enumerate(lines, start=1):
        words = line.split("#")[0].replace(",", " ").split()
        if not words:
            continue
        try:
            row = [float(word) for word in words]
        except ValueError:
            row = []
        if len(row) != 6 or not np.isfinite(row).all():
            raise InputError(f"Line {number} of {path} is {line.strip()!r}.", HOW)
        rows.append(row)
    if not rows:
        raise InputError(f"{path} has no marker.", HOW)
    return np.array(rows)


def marked_vertices(points: Floats, source: Figure, target: Figure) -> Ints:
    """The vertices (k, 2) of source and target nearest to the `points` (k, 6), which are in their files' units.

    InputError for a point that is FARTHEST from its body.
    """
    from scipy.spatial import cKDTree

    matched = []
    for figure, positions in ((source, points[:, :3]), (target, points[:, 3:])):
        used = np.unique(figure.triangles)
        far, nearest = cKDTree(figure.positions[used]).query(figure.scale * positions)
        worst = int(np.argmax(far))
        if far[worst] > FARTHEST:
            raise InputError(
                f"Marker {worst + 1} is {1e3 * far[worst]:.0f} mm away from {figure.name}.",
                f"It must lie on the body, in the units of its file ({figure.scale:g} m).",
            )
        matched.append(used[nearest])
    return np.column_stack(matched).astype(np.int64)
