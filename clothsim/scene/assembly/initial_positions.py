"""Initial positions of the cloths: from a file, the section [seed], or where the scene places them."""

from collections.abc import Sequence

import numpy as np

from clothsim.base.arrays import Floats, Ints, as_vector
from clothsim.base.errors import InputError
from clothsim.scene.assembly.meshes import cloth_shape
from clothsim.scene.assembly.placement import existing_file, placed
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


def cloths_at_start(scene: Scene) -> tuple[Floats, Ints]:
    """Positions (n, 3) [m] and triangles (m, 3) of all cloths at the start, neither sewn nor untangled.

    The rows are those of a file of the section [seed].
    """
    shapes = [cloth_shape(keys, f"cloth[{k}]", scene.directory) for k, keys in enumerate(scene.cloths)]
    given = initial_positions(scene, [len(shape.positions) for shape in shapes])
    starts = [
        placed(keys, shape.positions) if start is None else start
        for keys, shape, start in zip(scene.cloths, shapes, given, strict=True)
    ]
    first = np.cumsum([0, *(len(shape.positions) for shape in shapes)])
    triangles = np.concatenate([shape.triangles + k for shape, k in zip(shapes, first[:-1], strict=True)])
    return np.concatenate(starts), triangles
