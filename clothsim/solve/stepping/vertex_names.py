"""Names of rows of x as the scene gives them: "vertex 17 of cloth (pins)", "triangle 4 of ball"."""

from collections.abc import Iterable

import numpy as np

from clothsim.base.arrays import Ints
from clothsim.mesh.world import World
from clothsim.physics.energies.constraint import Constraint


def vertex_name(world: World, constraints: Iterable[Constraint], row: int) -> str:
    """Return the name of a row of x: its number in its object, and the constraint that prescribes it in brackets."""
    label = int(world.labels[row])
    of_rigid = (
        body.name
        for body, at in zip(world.rigid, world.coordinate_slices, strict=True)
        if row in range(at.start, at.stop)
    )
    if moving := next(of_rigid, ""):
        return moving
    holder = next(filter(None, (constraint.holder(row) for constraint in constraints)), "")
    if label < 0:
        return f"the clamped edge of {holder}"
    held = f" ({holder})" if holder else ""
    return f"vertex {row - first_row(world, label)} of {world.names[label]}{held}"


def simplex_name(world: World, constraints: Iterable[Constraint], rows: Ints) -> str:
    """Return the name of a vertex, an edge or a triangle, `rows (1..3,)` of x, by its number in its object."""
    if len(rows) == 1:
        return vertex_name(world, constraints, int(rows[0]))
    label = int(world.labels[rows[0]])
    own = rows - first_row(world, label)
    if len(rows) == 2:
        return f"edge {own[0]}-{own[1]} of {world.names[label]}"
    triangles = [thing.triangles for thing in world.cloths] + [thing.triangles for thing in world.bodies]
    alike = (np.sort(triangles[label], axis=1) == np.sort(own)).all(axis=1)
    return f"triangle {int(alike.argmax())} of {world.names[label]}"


def first_row(world: World, label: int) -> int:
    """Return the row of x of the first vertex of an object."""
    return (*world.cloth_slices, *world.body_slices)[label].start
