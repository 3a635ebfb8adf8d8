"""Initial positions of the cloths: of the scene, a file or a model (the section [seed]), untangled.

A drape from elsewhere may intersect itself, or a body: panels that were not sewn, seams whose vertices do not match,
layers through one another. Contact needs a start without intersections. And it may hold collapsed triangles, whose
energy would dominate the first step. Untangling is a heuristic, and is listed in the notes of a run; the rest shape
stays as it is.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from clothsim.base.arrays import Floats, Ints, as_vector
from clothsim.base.errors import InputError
from clothsim.files.meshes.mesh_file import read_mesh
from clothsim.geometry.kinematics.deformation_gradient import deformation_gradients
from clothsim.mesh.world import World
from clothsim.scene.assembly.meshes import cloth_shape
from clothsim.scene.assembly.shapes import existing_file, placed
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
        from clothsim.scene.assembly.moving_garment import positions_of_model

        positions = positions_of_model(file, scene)
    else:
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


STRETCHES = (0.3, 1.4)
"""Bounds of the principal stretches of a triangle at the start."""
INSIDE = (0.32, 1.38)
"""Stretches to which a triangle beyond the bounds is brought back: a little inside, for the steps converge slowly."""


def untangled(world: World) -> tuple[World, str]:
    """Free the start of the cloths of intersections.

    Parameters
    ----------
    world : World
        Cloths and bodies; bodies are wound outwards.

    Returns
    -------
    world : World
        The same with other initial positions.
    summary : str
        The number of intersections and the displacement of vertices, in a sentence.

    Raises
    ------
    InputError
        With a point where the start cannot be freed.

    Notes
    -----
    `untangling.untangle` frees it of intersections and brings triangles stretched beyond STRETCHES back to INSIDE.
    """
    from clothsim.geometry.untangling.untangle import untangle

    before, n = world.start(), world.n_cloth
    strained = len(_beyond(world, before))
    edges = np.concatenate([np.zeros((len(world.triangles), 2, 1)), world.rest_shapes], axis=2).transpose(0, 2, 1)
    body = (before[n:], world.body_triangles - n) if len(world.body_triangles) else None
    done = untangle(before[:n], world.triangles, material=edges, body=body, limits=INSIDE if strained else None)
    x = np.concatenate([done.positions, before[n:]])
    beyond = _beyond(world, x)
    if not done.free or len(beyond):
        what, where = f"{done.pairs} pairs of triangles still intersect", done.where
        if where is None:
            what = f"{len(beyond)} triangles still are stretched beyond {STRETCHES}"
            where = x[world.triangles[beyond[0], 0]]
        at = ", ".join(f"{value:.4g}" for value in where)
        raise InputError(
            f"seed.untangle: {what} after {done.rounds} rounds, one at ({at}) m.",
            "Start from a drape with fewer intersections.",
        )
    cloths = tuple(
        replace(cloth, positions=x[rows]) for cloth, rows in zip(world.cloths, world.cloth_slices, strict=True)
    )
    if not done.pairs_before and not strained:
        return replace(world, cloths=cloths), "seed.untangle: nothing intersected."
    moved = np.linalg.norm(x - before, axis=1)
    return replace(world, cloths=cloths), (
        f"seed.untangle: {done.pairs_before} pairs of triangles intersected and {strained} triangles were stretched "
        f"beyond {STRETCHES}; {np.count_nonzero(moved)} vertices were moved, at most {1e3 * moved.max():.2g} mm."
    )


def _beyond(world: World, x: Floats) -> Ints:
    """The triangles stretched beyond STRETCHES, (k,)."""
    F = np.asarray(deformation_gradients(x[: world.n_cloth], world.triangles, world.rest_shape_inverses), np.float64)
    stretches = np.linalg.svd(F, compute_uv=False)
    return np.flatnonzero((stretches[:, 1] < STRETCHES[0]) | (stretches[:, 0] > STRETCHES[1]))
