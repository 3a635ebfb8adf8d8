"""Meshes of the cases that no generator makes, as the text of an OBJ file."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from clothsim.arrays import Floats


def obj_text(positions: ArrayLike, triangles: ArrayLike) -> str:
    """The text of an OBJ: `positions (n, 3)` [m] to the last bit, `triangles (m, 3)` counted from 0."""
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in np.asarray(positions, np.float64).tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (np.asarray(triangles) + 1).tolist()]
    return "\n".join(lines) + "\n"


def flat(points: Sequence[Sequence[float]]) -> Floats:
    """Points (n, 2) of the plane z = 0, as (n, 3)."""
    return np.column_stack([np.asarray(points, np.float64), np.zeros(len(points))])
