"""MakeHuman clothes (.mhclo): the vertices of a garment relative to the base mesh that it was modelled on.

A line is a vertex of the base, or three of them with weights and an offset, which is in units of the base's own size:
with `x_scale a b length` the vertices a and b of the base were `length` apart in x when the garment was made.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.base.file_reading import read_regular_file

_SCALES = ("x_scale", "y_scale", "z_scale")


@dataclass(frozen=True)
class Clothes:
    """A garment bound to a base mesh.

    obj_file: the garment's mesh; corners (n, 3): vertices of the base, with weights (n, 3) and offsets (n, 3);
    scales: for x, y and z two vertices of the base and their distance.
    """

    obj_file: Path
    corners: np.ndarray
    weights: Floats
    offsets: Floats
    scales: tuple[tuple[int, int, float] | None, ...]

    def on(self, base: Floats) -> Floats:
        """The garment's vertices on a base mesh `(k, 3)`, in its unit. InputError where the base has too few."""
        named = [*self.corners.ravel().tolist(), *(i for scale in self.scales if scale for i in scale[:2])]
        if max(named) >= len(base):
            raise InputError(
                f"{self.obj_file.stem} is modelled on a base mesh of at least {max(named) + 1:,} vertices, "
                f"not of {len(base):,}.",
                "Give the MakeHuman base mesh as --made-for.",
            )
        size = np.ones(3)
        for axis, scale in enumerate(self.scales):
            if scale is not None:
                a, b, length = scale
                size[axis] = abs(base[a, axis] - base[b, axis]) / length
        return np.einsum("nk,nkj->nj", self.weights, base[self.corners]) + self.offsets * size


def read_clothes(path: Path) -> Clothes:
    """The clothes in a .mhclo file. InputError with the line that cannot be read."""
    lines = read_regular_file(path).decode("utf-8", errors="replace").splitlines()
    scales: list[tuple[int, int, float] | None] = [None, None, None]
    obj_file, rows, in_vertices = None, [], False
    for number, line in enumerate(lines, start=1):
        words = line.split("#", 1)[0].split()
        if not words:
            continue
        try:
            if words[0] in _SCALES:
                length = float(words[3])
                if not 0 < length < float("inf"):
                    raise ValueError
                scales[_SCALES.index(words[0])] = _index(words[1]), _index(words[2]), length
            elif words[0] == "obj_file":
                obj_file = path.parent / Path(words[1]).name
            elif words[0] == "verts":
                in_vertices = True
            elif in_vertices and words[0][0] in "+-.0123456789":
                rows.append(_row(words))
            else:
                in_vertices = False
        except (ValueError, IndexError) as error:
            raise InputError(f"{path}, line {number}: {line[:60]!r} cannot be read.") from error
    if obj_file is None or not rows:
        raise InputError(f"{path} names no obj_file, or no verts.", "Give a MakeHuman .mhclo file.")
    table = np.array(rows)
    return Clothes(obj_file, table[:, :3].astype(np.int64), table[:, 3:6], table[:, 6:], tuple(scales))


def _row(words: list[str]) -> list[float]:
    if len(words) == 1:
        return [_index(words[0])] * 3 + [1.0, 0.0, 0.0] + [0.0] * 3
    numbers = [float(word) for word in words[3:9]]
    if len(numbers) != 6 or not np.isfinite(numbers).all():
        raise ValueError
    return [*(float(_index(word)) for word in words[:3]), *numbers]


def _index(word: str) -> int:
    index = int(word)
    if not 0 <= index < 2**31:
        raise ValueError
    return index
