"""Where the cloths start, if not where their tables place them: the [seed] section."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from clothsim.arrays import Floats, as_vector
from clothsim.errors import InputError
from clothsim.scene.settings import Seed


def seeded(seed: Seed, directory: Path, counts: Sequence[int]) -> list[Floats | None]:
    """The start of each cloth of `counts` vertices, before it is sewn, (n, 3) [m]; None where the scene places it.

    InputError for a file with another number of vertices than the cloths have together.
    """
    if seed.from_ == "rest":
        return [None] * len(counts)
    from clothsim.io.mesh_file import read_mesh

    positions = read_mesh(directory / seed.file, vertices=seed.vertices).positions
    if len(positions) != sum(counts):
        part = "" if seed.vertices is None else f" in {list(seed.vertices)}"
        raise InputError(
            f"seed.file {seed.file} has {len(positions)} vertices{part}, the cloths have {sum(counts)}.",
            "It gives a place to each vertex of the cloths' meshes, as they are before weld.",
        )
    moved = positions + as_vector("seed.position", (0, 0, 0) if seed.position is None else seed.position)
    return list(np.split(moved, np.cumsum(counts)[:-1]))
