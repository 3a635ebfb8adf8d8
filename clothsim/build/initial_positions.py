"""Initial positions of the cloths from a file: the section [seed]."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from clothsim.arrays import Floats, as_vector
from clothsim.build.placement import existing_file
from clothsim.errors import InputError
from clothsim.scene.settings import Seed


def initial_positions(seed: Seed, directory: Path, counts: Sequence[int]) -> list[Floats | None]:
    """The initial positions of each cloth before it is sewn.

    Parameters
    ----------
    seed : Seed
        The section [seed].
    directory : Path
        Folder at which relative file names start.
    counts : sequence of int
        Number of vertices of each cloth.

    Returns
    -------
    list of (n, 3) ndarray [m] or None
        None where the scene places the cloth.

    Raises
    ------
    InputError
        For a file with another number of vertices than the cloths have together.
    """
    if seed.from_ == "rest":
        return [None] * len(counts)
    from clothsim.io.mesh_file import read_mesh

    file = existing_file("seed.file", directory, seed.file)
    positions = read_mesh(file, vertices=seed.vertices).positions
    if len(positions) != sum(counts):
        part = "" if seed.vertices is None else f" in {list(seed.vertices)}"
        raise InputError(
            f"seed.file {seed.file} has {len(positions)} vertices{part}, the cloths have {sum(counts)}.",
            "Give a file with a position for each vertex of the cloths' meshes, as they are before weld.",
        )
    moved = positions + as_vector("seed.position", (0, 0, 0) if seed.position is None else seed.position)
    return list(np.split(moved, np.cumsum(counts)[:-1]))
