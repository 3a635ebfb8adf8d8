"""Untangling: a start freed of intersections, the key `untangle` of [seed].

A drape from elsewhere may intersect itself, or a body: panels that were not sewn, seams whose vertices do not match,
layers through one another. Contact needs a start without intersections. And it may hold collapsed triangles, whose
energy would dominate the first step. This is a heuristic, and is listed in the notes of a run; the rest shape stays as
it is.
"""

from dataclasses import replace

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.geometry.kinematics.deformation_gradient import deformation_gradients
from clothsim.mesh.world import World

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
        _refuse(x, world.triangles, done.pairs, done.rounds, done.where, beyond)
    return _started(world, x), _summary(np.linalg.norm(x - before, axis=1), done.pairs_before, strained)


def _beyond(world: World, x: Floats) -> Ints:
    """The triangles stretched beyond STRETCHES, (k,)."""
    F = np.asarray(deformation_gradients(x[: world.n_cloth], world.triangles, world.rest_shape_inverses), np.float64)
    stretches = np.linalg.svd(F, compute_uv=False)
    return np.flatnonzero((stretches[:, 1] < STRETCHES[0]) | (stretches[:, 0] > STRETCHES[1]))


def _refuse(x: Floats, cloth: Ints, pairs: int, rounds: int, where: Floats | None, beyond: Ints) -> None:
    """InputError for a start that still intersects, or is strained, with a point."""
    what = f"{pairs} pairs of triangles still intersect"
    if where is None:
        what, where = f"{len(beyond)} triangles still are stretched beyond {STRETCHES}", x[cloth[beyond[0], 0]]
    at = ", ".join(f"{value:.4g}" for value in where)
    raise InputError(
        f"seed.untangle: {what} after {rounds} rounds, one at ({at}) m.",
        "Start from a drape with fewer intersections.",
    )


def _started(world: World, x: Floats) -> World:
    cloths = tuple(
        replace(cloth, positions=x[rows]) for cloth, rows in zip(world.cloths, world.cloth_slices, strict=True)
    )
    return replace(world, cloths=cloths)


def _summary(moved: Floats, pairs: int, strained: int) -> str:
    if not pairs and not strained:
        return "seed.untangle: nothing intersected."
    count, most = np.count_nonzero(moved), 1e3 * moved.max()
    return (
        f"seed.untangle: {pairs} pairs of triangles intersected and {strained} triangles were stretched beyond "
        f"{STRETCHES}; {count} vertices were moved, at most {most:.2g} mm."
    )
