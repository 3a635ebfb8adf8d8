"""Initial positions of the cloths from a file: the section [seed]."""

from collections.abc import Sequence

import numpy as np

from clothsim.base.arrays import Floats, as_vector
from clothsim.base.errors import InputError
from clothsim.scene.assembly.placement import existing_file
from clothsim.scene.scene import Scene


def initial_positions(scene: Scene, counts: Sequence[int]) -> list[Floats | None]:
    """The initial positions of each cloth before it is sewn.

    Parameters
    ----------
    scene : Scene
        Its section [seed].
    counts : sequence of int
        Number of vertices of each cloth.

    Returns
    -------
    list of (n, 3) ndarray [m] or None
        None where the scene places the cloth.

    Raises
    ------
    InputError
        For a file with another number of vertices than the cloths have together, or a model of other drapes.
    """
    seed = scene.seed_settings
    if seed.from_ == "rest":
        return [None] * len(counts)
    file = existing_file("seed.file", scene.directory, seed.file)
    if seed.from_ == "model":
        from clothsim.scene.assembly.drape_model import predicted, read_model

        positions = predicted(read_model(file), scene)
    else:
        from clothsim.files.meshes.mesh_file import read_mesh

        positions = read_mesh(file, vertices=seed.vertices).positions
    if len(positions) != sum(counts):
        part = "" if seed.vertices is None else f" in {list(seed.vertices)}"
        raise InputError(
            f"seed.file {seed.file} has {len(positions)} vertices{part}, the cloths have {sum(counts)}.",
            "Give a file with a position for each vertex of the cloths' meshes, as they are before weld.",
        )
    moved = positions + as_vector("seed.position", (0, 0, 0) if seed.position is None else seed.position)
    return list(np.split(moved, np.cumsum(counts)[:-1]))
