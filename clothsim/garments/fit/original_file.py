"""File that a garment came in, and its copy in the shape of the fit."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.files import MeshFile, moved_obj, read_mesh
from clothsim.garments.penetration import NO_ROWS

HEADER = "# fitted by clothsim: positions in metres; else as in {name}{changes}\n"


@dataclass(frozen=True)
class Original:
    """OBJ file of a garment; rows (k,): vertex of the garment of each vertex of the file, -1 where it is in none.

    name: of the file, empty where there is none; text: its content.
    """

    name: str = ""
    text: str = field(default="", repr=False)
    rows: Ints = field(default_factory=lambda: np.zeros(0, np.int64), repr=False, compare=False)

    @property
    def note(self) -> str:
        """Differences of the copy from the file in words, empty where only the positions differ."""
        left = self.rows[self.rows >= 0]
        differences = [
            (len(self.rows) - len(left), "{:,} vertices that are not of the garment are left out"),
            (len(left) - len(np.unique(left)), "{:,} vertices coincide with those that they were welded to"),
        ]
        return "; ".join(words.format(count) for count, words in differences if count)

    def moved_to(self, positions: Floats) -> str:
        """Text of the file with the garment at `positions` (n, 3) [m]. InputError where its vertices cannot be read."""
        changes = f"; {self.note}" if self.note else ""
        return HEADER.format(name=" ".join(self.name.split()), changes=changes) + moved_obj(
            self.text, positions, self.rows
        )


NO_ORIGINAL = Original()
"""A garment from memory, from a generator, or from a file other than OBJ."""


def original_of(file: Path, mesh: MeshFile, sewn: Ints = NO_ROWS) -> Original:
    """The OBJ `file` that `mesh` was read from; none for another kind of file.

    sewn (n,): vertex of the garment of each vertex of the mesh; empty: its own.
    """
    if file.suffix.lower() != ".obj":
        return NO_ORIGINAL
    text = file.read_text(encoding="utf-8", errors="replace")
    rows = np.arange(len(mesh.positions))
    if len(sewn):
        rows = sewn
    if len(mesh.used):
        whole = np.full(mesh.used.max() + 1, -1)
        whole[mesh.used] = rows
        rows = whole
    return Original(file.name, text, rows)


def original_of_scene(cloth: Mapping[str, Any], folder: Path, vertices: int) -> Original:
    """The OBJ file of a scene's cloth; none where it takes a part of one or sews it, or generates its mesh."""
    name = cloth["mesh"]
    cut = [key for key in ("group", "component", "vertices", "weld", "rest") if key in cloth]
    file = folder / str(name)
    if not isinstance(name, str) or cut or file.suffix.lower() != ".obj" or not file.is_file():
        return NO_ORIGINAL
    mesh = read_mesh(file)
    if len(mesh.positions) != vertices:
        return NO_ORIGINAL
    return original_of(file, mesh)


def fitted_text(original: Original, positions: Floats) -> str | None:
    """Text of `Original.moved_to`; None where there is no such file, or its rows do not fit the garment."""
    if not original.name or original.rows.max(initial=-1) >= len(positions):
        return None
    try:
        return original.moved_to(positions)
    except (InputError, ValueError, IndexError):  # a file that only the reader of triangles understands
        return None
