"""OBJ output, exact to the last bit."""

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from clothsim.base.safe_files.atomic import write_atomically


def obj_text(positions: ArrayLike, triangles: ArrayLike) -> str:
    """The text of an OBJ of positions (n, 3) [m] and triangles (m, 3) counted from 0.

    Examples
    --------
    >>> print(obj_text([[0, 0, 0], [1, 0, 0], [0, 0.1, 0]], [[0, 1, 2]]), end="")
    v 0.0 0.0 0.0
    v 1.0 0.0 0.0
    v 0.0 0.1 0.0
    f 1 2 3
    """
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in np.asarray(positions, np.float64).tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (np.asarray(triangles) + 1).tolist()]
    return "\n".join(lines) + "\n"


def write_obj(path: Path, positions: ArrayLike, triangles: ArrayLike) -> Path:
    """Write `obj_text` to `path` and return it. InputError where it cannot be written."""
    write_atomically(path, obj_text(positions, triangles).encode())
    return path
