"""OBJ output, exact to the last bit: of a mesh, or as a copy of a file with other vertex positions.

A copy is an edit of the text: faces, groups, materials and texture coordinates stay, a `v` line gets its new numbers
and keeps what follows them (colours). Normals (`vn`) are left out, as they are those of the old positions.
"""

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.base.file_writing import write_atomically
from clothsim.files.meshes.obj import joined_lines


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


ELEMENTS = ("f", "l", "p")
"""Lines that name vertices."""


def moved_obj(text: str, positions: Floats, rows: Ints) -> str:
    r"""Text of the OBJ `text` with other vertex positions.

    Parameters
    ----------
    text : str
        An OBJ file that `clothsim.files.meshes.obj.read_obj` reads.
    positions : (n, 3) ndarray
        New positions.
    rows : (k,) ndarray
        Row of `positions` of each vertex of the file; -1: the vertex is left out, and what names it, as are those
        that have no row.

    Raises
    ------
    InputError
        Where the file has fewer vertices.

    Examples
    --------
    >>> text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\ng front\nf 1/1 2/1 3/1 4/1\n"
    >>> print(moved_obj(text, 2.0 * np.eye(3), np.array([0, 1, 2, 0])), end="")
    v 2.0 0.0 0.0
    v 0.0 2.0 0.0
    v 0.0 0.0 2.0
    v 2.0 0.0 0.0
    vt 0 0
    g front
    f 1/1 2/1 3/1 4/1
    """
    table = positions.tolist()
    numbers = (np.cumsum(rows >= 0) * (rows >= 0)).tolist()
    lines, seen = [], 0
    for line in joined_lines(text):
        words = line.split("#", 1)[0].split()
        keyword = words[0] if words else ""
        if keyword == "v":
            row = rows[seen] if seen < len(rows) else -1
            seen += 1
            if row >= 0:
                x, y, z = table[row]
                lines.append(" ".join(["v", repr(x), repr(y), repr(z), *words[4:]]))
        elif keyword in ELEMENTS:
            corners = _corners(words[1:], seen, numbers)
            if corners:
                lines.append(" ".join([keyword, *corners]))
        elif keyword != "vn":
            lines.append(line)
    if seen < len(rows):
        raise InputError(f"The file has {seen:,} vertices, fewer than {len(rows):,}.")
    return "\n".join(lines).rstrip("\n") + "\n"


def _corners(words: list[str], seen: int, numbers: list[int]) -> list[str]:
    """Corners without normals and with the new `numbers`, from 1; empty where a vertex is left out (0)."""
    corners = []
    for word in words:
        vertex, _, rest = word.partition("/")
        texture = rest.partition("/")[0]
        index = int(vertex)
        row = index - 1 if index > 0 else seen + index
        if row >= len(numbers) or not numbers[row]:
            return []
        corners.append(f"{numbers[row]}/{texture}" if texture else f"{numbers[row]}")
    return corners
