"""Freeing a start of intersections: the key `untangle` of [seed]. A heuristic, told as such; only the start moves.

A drape that comes from elsewhere may cross itself, or a body, by a millimetre: panels that were not sewn, seams whose
vertices do not match. Contact can only start where nothing intersects.
"""

from dataclasses import replace

import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.errors import InputError
from clothsim.mesh.topology import unique_edges, vertex_rings
from clothsim.mesh.world import World

ROUNDS = 50
"""After so many the crossings are no accident of the seams."""
PUSH = 0.07
"""How far a round moves cloth off a body, as a share of the median edge."""


def untangled(world: World) -> tuple[World, str]:
    """The world with its cloths' start freed of intersections, and what was done.

    In each round the corners of triangles that intersect cloth go half of the way to the mean of their neighbours, and
    those of triangles that intersect a body go PUSH edges along its normals: bodies are wound outwards. The material's
    rest shape stays. InputError names a place where ROUNDS rounds do not help.
    """
    from clothsim.intersection.pairs import intersecting_pairs, places

    before = world.start()
    x, cloth, body = before.copy(), world.triangles, world.body_triangles
    edges = unique_edges(cloth)
    push = PUSH * float(np.median(np.linalg.norm(x[edges[:, 0]] - x[edges[:, 1]], axis=1)))
    rings = vertex_rings(cloth, world.n_cloth)
    first = 0
    for done in range(ROUNDS + 1):
        own, with_body = intersecting_pairs(x, cloth), intersecting_pairs(x, cloth, body)
        count = len(own) + len(with_body)
        first = first or count
        if not count:
            break
        if done == ROUNDS:
            other, pairs = (cloth, own) if len(own) else (body, with_body)
            place = ", ".join(f"{value:.4g}" for value in places(x, cloth, other, pairs[:1])[0])
            raise InputError(
                f"seed.untangle: {count} of {first} pairs of triangles still intersect after {ROUNDS} rounds, one at "
                f"({place}) m.",
                "Start from a drape that is nearer to free of intersections.",
            )
        _smooth(x, np.unique(cloth[own]), rings)
        _push(x, cloth, body, with_body, push)
    return _started(world, x), _said(np.linalg.norm(x - before, axis=1), first)


def _smooth(x: Floats, vertices: Ints, rings: tuple[Ints, Ints]) -> None:
    """Move `vertices` half of the way to the mean of their neighbours, all at once."""
    starts, neighbours = rings
    means = [x[neighbours[starts[v] : starts[v + 1]]].mean(axis=0) for v in vertices]
    if means:
        x[vertices] = 0.5 * (x[vertices] + np.stack(means))


def _push(x: Floats, cloth: Ints, body: Ints, pairs: Ints, distance: float) -> None:
    """Move the corners of `cloth[pairs[:, 0]]` by `distance` [m] along the mean normal of the body triangles there."""
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


def _started(world: World, x: Floats) -> World:
    cloths = tuple(
        replace(cloth, positions=x[rows]) for cloth, rows in zip(world.cloths, world.cloth_slices, strict=True)
    )
    return replace(world, cloths=cloths)


def _said(moved: Floats, pairs: int) -> str:
    if not pairs:
        return "seed.untangle: nothing intersected."
    count, most = np.count_nonzero(moved), 1e3 * moved.max()
    return f"seed.untangle: {pairs} pairs of triangles intersected; {count} vertices were moved, at most {most:.2g} mm."
