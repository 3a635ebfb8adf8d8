"""Clamped edges: pins that also fix the rest direction of the cloth, by ghost triangles behind the edge.

A pinned edge lets the cloth rotate about it freely. A clamp adds the missing neighbour: behind every border edge whose
two ends are pinned lies a ghost triangle, the mirror image of the border triangle in its own plane at the start. The
hinge between them is at rest when the cloth leaves the edge in that plane.

An ordinary hinge lumps the bending of half a cell on either side. At a clamp one of those halves does not bend, so the
hinge is twice as stiff. The same holds where whole triangles are pinned, for the hinges between those and the rest.
Without the factor the clamp is half a cell too far back, and the result of first order in the mesh size
(docs/results/validation.md, A3).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.mesh.cloth import Hinges, corner_over_edge, join_hinges
from clothsim.mesh.topology import border_edges
from clothsim.mesh.world import World


def clamped(world: World, groups: Sequence[Ints]) -> tuple[World, tuple[Ints, ...]]:
    """Add ghost triangles for clamped pin groups.

    Parameters
    ----------
    world : World
        World without the clamps.
    groups : sequence of (k,) int64
        Pinned cloth vertices of each group (world numbers); an edge is clamped where both its ends are in the same
        group.

    Returns
    -------
    world : World
        The world with ghosts and their hinges.
    ghosts : tuple of (g,) int64
        Rows of x of the ghosts of each group, which move with it; none for an empty group.

    Raises
    ------
    InputError
        Where a group has neither a border edge nor a triangle to clamp.
    """
    rows: list[Ints] = []
    for number, group in enumerate(groups):
        before = world.n_vertices
        changed = _clamp_group(world, np.asarray(group, np.int64))
        if changed is world and len(group):
            raise InputError(
                f"Pin group {number} has nothing to clamp: no border edge with both ends in it and no whole triangle.",
                "Pin two neighbours on the border, or set clamp = false.",
            )
        world = changed
        rows.append(np.arange(before, world.n_vertices))
    return world, tuple(rows)


def _clamp_group(world: World, group: Ints) -> World:
    """World with one group clamped; the same object where that adds or changes nothing."""
    pinned = np.zeros(world.n_vertices, bool)
    pinned[group] = True
    line = _clamp_lines(world.hinges, pinned)
    stiffness = np.where(line, 2 * world.hinges.stiffness, world.hinges.stiffness)
    held = np.where(line, np.where(pinned[world.hinges.vertices[:, 2]], 0, 1), world.hinges.held)
    parts, ghosts = [replace(world.hinges, stiffness=stiffness, held=held)], [world.ghosts]
    for k in range(len(world.cloths)):
        hinges, positions = _ghost_hinges(world, k, pinned, world.n_vertices + sum(map(len, ghosts[1:])))
        parts.append(hinges)
        ghosts.append(positions)
    if not line.any() and not any(len(part) for part in ghosts[1:]):
        return world
    return replace(world, hinges=join_hinges(parts), ghosts=np.concatenate(ghosts))


def _clamp_lines(hinges: Hinges, pinned: np.ndarray) -> np.ndarray:
    """Hinges between a triangle with all corners pinned and one with a free corner, (h,) bool."""
    held = pinned[hinges.vertices]
    return held[:, 0] & held[:, 1] & (held[:, 2] != held[:, 3])


def _ghost_hinges(world: World, cloth_number: int, pinned: np.ndarray, first_ghost: int) -> tuple[Hinges, Floats]:
    """Hinges about the pinned border edges of one cloth, and their ghosts (g, 3) [m], rows first_ghost... of x."""
    cloth, offset = world.cloths[cloth_number], world.cloth_slices[cloth_number].start
    edges, half = border_edges(cloth.triangles)
    triangles, opposite = half // 3, cloth.triangles.ravel()[half // 3 * 3 + (half + 2) % 3]
    chosen = pinned[edges + offset].all(axis=1) & ~pinned[opposite + offset]
    edges, triangles, opposite = edges[chosen], triangles[chosen], opposite[chosen]
    ghosts = _mirrored(cloth.name, cloth.positions, edges, opposite)
    vertices = np.column_stack([edges, opposite, opposite])
    length, along, height = corner_over_edge(cloth.triangles, cloth.material_coordinates, vertices, triangles, 0)
    corners = np.zeros((len(vertices), 4, 2))
    corners[:, 1, 0] = length
    corners[:, 2:, 0] = along[:, None]
    corners[:, 2:, 1] = height[:, None] * [1.0, -1.0]
    vertices = vertices + offset
    vertices[:, 3] = first_ghost + np.arange(len(vertices))
    stiffness = 2 * cloth.per_triangle("bending_stiffness")[triangles]
    return Hinges(vertices, corners, np.zeros(len(vertices)), stiffness, np.ones(len(vertices), np.int64)), ghosts


def _mirrored(name: str, positions: Floats, edges: Ints, corners: Ints) -> Floats:
    """`corners (g,)` mirrored about the lines of `edges (g, 2)`, each within its triangle's plane, (g, 3) [m]."""
    start, corner = positions[edges[:, 0]], positions[corners]
    edge, to_corner = positions[edges[:, 1]] - start, corner - start
    squared = np.einsum("ij,ij->i", edge, edge)
    twice_area = np.linalg.norm(np.cross(edge, to_corner), axis=1)
    bad = np.flatnonzero(~(twice_area > 1e-14 * squared))
    if bad.size:
        a, b = edges[bad[0]]
        raise InputError(
            f"{name}: the triangle at the clamped edge {a}-{b} has no area at the start.", "Start it unfolded."
        )
    foot = start + (np.einsum("ij,ij->i", to_corner, edge) / squared)[:, None] * edge
    return 2 * foot - corner
