"""Prescribed vertices, fixed or on a rigid motion, and clamped edges: the effect `pins`.

A pinned edge lets the cloth rotate about it freely. A clamp also fixes the rest direction of the cloth, by the missing
neighbour: behind every border edge whose two ends are pinned lies a ghost triangle, the mirror image of the border
triangle in its own plane at the start. The hinge between them is at rest when the cloth leaves the edge in that plane.

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
from clothsim.keys.typed_effects import Pins
from clothsim.mesh.body import prescribed_motion
from clothsim.mesh.cloth import Hinges, corner_over_edge, join_hinges
from clothsim.mesh.topology import border_edges
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Constraint, Off, PinnedGroup, PinsConstraint
from clothsim.physics.energies.example import Example
from clothsim.physics.energies.key_values import selected_vertices


def pins(world: World, keys: Pins) -> tuple[World, Constraint] | Off:
    """The world, which clamps enlarge by ghost vertices, and the constraint; off where no vertex is selected.

    Raises
    ------
    InputError
        For unknown selections, or a vertex in two groups.
    """
    groups = [("pins", keys), *((f"pins.group[{k}]", group) for k, group in enumerate(keys.group))]
    selected = [(selected_vertices("effects.pins.select", world, each.select), each, name) for name, each in groups]
    chosen = [(vertices, each, name) for vertices, each, name in selected if len(vertices)]
    if not chosen:
        return Off("no vertex is selected")
    numbers, counts = np.unique(np.concatenate([vertices for vertices, _, _ in chosen]), return_counts=True)
    if (counts > 1).any():
        raise InputError(
            f"effects.pins: vertex {numbers[counts > 1][0]} is in two groups.", "Give each vertex one motion."
        )
    none = np.zeros(0, np.int64)
    world, ghosts = clamped(world, [vertices if each.clamp else none for vertices, each, _ in chosen])
    start = world.start()
    pinned = []
    for (vertices, each, name), extra in zip(chosen, ghosts, strict=True):
        rows = np.concatenate([vertices, extra])
        motion = prescribed_motion(each.motion, start[vertices].mean(axis=0) + world.origin, world.origin)
        pinned.append(PinnedGroup(rows, start[rows], motion, name))
    return world, PinsConstraint(tuple(pinned))


EXAMPLE = Example(
    keys={"select": "corners", "motion": {"velocity": (1.0, 2.0, 3.0), "rotate_degrees_per_second": (0, 90, 0)}},
    in_scene={"select": "corners"},
    zero={"select": []},
)


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
    corners = pinned[world.hinges.vertices]
    # between a triangle with all corners pinned and one with a free corner
    line = corners[:, 0] & corners[:, 1] & (corners[:, 2] != corners[:, 3])
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


def _ghost_hinges(world: World, cloth_number: int, pinned: np.ndarray, first_ghost: int) -> tuple[Hinges, Floats]:
    """Hinges about the pinned border edges of one cloth, and their ghosts (g, 3) [m], rows first_ghost... of x."""
    cloth, offset = world.cloths[cloth_number], world.cloth_slices[cloth_number].start
    edges, half = border_edges(cloth.triangles)
    triangles, opposite = half // 3, cloth.triangles.ravel()[half // 3 * 3 + (half + 2) % 3]
    chosen = pinned[edges + offset].all(axis=1) & ~pinned[opposite + offset]
    edges, triangles, opposite = edges[chosen], triangles[chosen], opposite[chosen]
    # the opposite corner mirrored about the line of the edge, within the plane of the triangle
    start, corner = cloth.positions[edges[:, 0]], cloth.positions[opposite]
    edge, to_corner = cloth.positions[edges[:, 1]] - start, corner - start
    squared = np.einsum("ij,ij->i", edge, edge)
    bad = np.flatnonzero(~(np.linalg.norm(np.cross(edge, to_corner), axis=1) > 1e-14 * squared))
    if bad.size:
        a, b = edges[bad[0]]
        raise InputError(
            f"{cloth.name}: the triangle at the clamped edge {a}-{b} has no area at the start.", "Start it unfolded."
        )
    foot = start + (np.einsum("ij,ij->i", to_corner, edge) / squared)[:, None] * edge
    ghosts = 2 * foot - corner
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
