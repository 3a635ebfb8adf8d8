"""Untangling: a start freed of intersections, the key `untangle` of [seed].

A drape from elsewhere may intersect itself, or a body, by a millimetre: panels that were not sewn, seams whose vertices
do not match. Contact needs a start without intersections. And it may hold collapsed triangles, whose energy would
dominate the first step. This is a heuristic, and is listed in the notes of a run; the rest shape stays as it is.
"""

from dataclasses import replace

import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.errors import InputError
from clothsim.kinematics.deformation_gradient import deformation_gradients
from clothsim.mesh.topology import unique_edges, vertex_rings
from clothsim.mesh.world import World

ROUNDS = 200
"""Largest number of rounds."""
PUSH = 0.03
"""Displacement of cloth away from a body in a round, as fraction of the median edge."""
STRETCHES = (0.3, 1.4)
"""Bounds of the principal stretches of a triangle at the start."""
INSIDE = (0.32, 1.38)
"""Stretches to which a triangle beyond the bounds is projected: a little inside, for the rounds converge slowly."""


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
        With a point where ROUNDS rounds do not free the start.

    Notes
    -----
    In each round the corners of triangles that intersect cloth move half of the displacement to the mean of their
    neighbours, those of triangles that intersect a body move PUSH edges along its normals, and triangles stretched
    beyond STRETCHES are projected to INSIDE.
    """
    from clothsim.intersection.intersecting_pairs import intersecting_pairs

    before = world.start()
    x, cloth, body = before.copy(), world.triangles, world.body_triangles
    push, rings = PUSH * _median_edge(x, cloth), vertex_rings(cloth, world.n_cloth)
    first, strained = 0, 0
    for done in range(ROUNDS + 1):
        own, with_body = intersecting_pairs(x, cloth), intersecting_pairs(x, cloth, body)
        count, beyond = len(own) + len(with_body), _beyond(world, x)
        if done == 0:
            first, strained = count, len(beyond)
        if not count and not len(beyond):
            break
        if done == ROUNDS:
            _refuse(x, cloth, body, own, with_body, beyond)
        _smooth(x, np.unique(cloth[own]), rings)
        _push(x, cloth, body, with_body, push)
        _relax(world, x, beyond)
    return _started(world, x), _summary(np.linalg.norm(x - before, axis=1), first, strained)


def _median_edge(x: Floats, triangles: Ints) -> float:
    edges = unique_edges(triangles)
    return float(np.median(np.linalg.norm(x[edges[:, 0]] - x[edges[:, 1]], axis=1)))


def _beyond(world: World, x: Floats) -> Ints:
    """The triangles stretched beyond STRETCHES, (k,)."""
    stretches = np.linalg.svd(_gradients(world, x), compute_uv=False)
    return np.flatnonzero((stretches[:, 1] < STRETCHES[0]) | (stretches[:, 0] > STRETCHES[1]))


def _gradients(world: World, x: Floats) -> Floats:
    return np.asarray(deformation_gradients(x[: world.n_cloth], world.triangles, world.rest_shape_inverses), np.float64)


def _smooth(x: Floats, vertices: Ints, rings: tuple[Ints, Ints]) -> None:
    """Move `vertices` by half of the displacement to the mean of their neighbours, all at once."""
    starts, neighbours = rings
    means = [x[neighbours[starts[v] : starts[v + 1]]].mean(axis=0) for v in vertices]
    if means:
        x[vertices] = 0.5 * (x[vertices] + np.stack(means))


def _push(x: Floats, cloth: Ints, body: Ints, pairs: Ints, distance: float) -> None:
    """Move the corners of `cloth[pairs[:, 0]]` by `distance` [m] along the mean normal of their body triangles."""
    if not len(pairs):
        return
    corners = x[body[pairs[:, 1]]]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    along = np.zeros_like(x)
    np.add.at(along, cloth[pairs[:, 0]], normals[:, None])
    length = np.linalg.norm(along, axis=1)
    moved = length > 0
    x[moved] += distance * along[moved] / length[moved, None]


def _relax(world: World, x: Floats, beyond: Ints) -> None:
    """Project each triangle of `beyond` to stretches INSIDE; a vertex takes the mean of its corners.

    F = U S V' -> U clip(S) V' about the triangle's centre: the local step of projective dynamics (Bouaziz et al. 2014).
    """
    if not len(beyond):
        return
    U, stretches, Vt = np.linalg.svd(_gradients(world, x)[beyond], full_matrices=False)
    F = U @ (np.clip(stretches, *INSIDE)[:, :, None] * Vt)
    edges = (F @ world.rest_shapes[beyond]).transpose(0, 2, 1)
    corners = world.triangles[beyond]
    shape = np.concatenate([np.zeros((len(beyond), 1, 3)), edges], axis=1)
    target = shape - shape.mean(axis=1, keepdims=True) + x[corners].mean(axis=1, keepdims=True)
    total, count = np.zeros_like(x), np.bincount(corners.ravel(), minlength=len(x))
    np.add.at(total, corners, target - x[corners])
    x += total / np.maximum(count, 1)[:, None]


def _refuse(x: Floats, cloth: Ints, body: Ints, own: Ints, with_body: Ints, beyond: Ints) -> None:
    """InputError for a start that still intersects, with a point."""
    from clothsim.intersection.intersecting_pairs import intersection_points

    if len(own) or len(with_body):
        other, pairs = (cloth, own) if len(own) else (body, with_body)
        what, position = (
            f"{len(own) + len(with_body)} pairs of triangles still intersect",
            intersection_points(x, cloth, other, pairs)[0],
        )
    else:
        what = f"{len(beyond)} triangles still are stretched beyond {STRETCHES}"
        position = x[cloth[beyond[0], 0]]
    at = ", ".join(f"{value:.4g}" for value in position)
    raise InputError(
        f"seed.untangle: {what} after {ROUNDS} rounds, one at ({at}) m.",
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
