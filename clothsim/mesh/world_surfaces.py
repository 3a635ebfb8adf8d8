"""Surfaces of a world: rows of x and triangles of each cloth and body."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from clothsim.base.arrays import Ints
from clothsim.base.errors import InputError
from clothsim.mesh.world import World


@dataclass(frozen=True)
class Surface:
    """A cloth or body.

    rows: of x; triangles (m, 3): in rows of x; moving: False where its positions are the same in all frames; rigid:
    True for a rigid body that forces move.
    """

    name: str
    role: Literal["cloth", "body"]
    rows: slice
    triangles: Ints
    moving: bool
    rigid: bool = False

    @property
    def n_vertices(self) -> int:
        """Number of vertices."""
        return self.rows.stop - self.rows.start

    @property
    def own_triangles(self) -> Ints:
        """The triangles counted from the surface's own first vertex, (m, 3)."""
        return self.triangles - self.rows.start


def world_surfaces(world: World) -> tuple[Surface, ...]:
    """The surfaces of a world in the order of its rows of x: cloths, then bodies."""
    cloths = [
        Surface(cloth.name, "cloth", rows, cloth.triangles + rows.start, True)
        for cloth, rows in zip(world.cloths, world.cloth_slices, strict=True)
    ]
    prescribed = len(world.prescribed_bodies)
    bodies = [
        Surface(
            body.name,
            "body",
            rows,
            body.triangles + rows.start,
            moving=not body.motion.still or number >= prescribed,
            rigid=number >= prescribed,
        )
        for number, (body, rows) in enumerate(zip(world.bodies, world.body_slices, strict=True))
    ]
    return (*cloths, *bodies)


def check_surfaces(surfaces: Sequence[Surface]) -> None:
    """InputError unless at least one cloth, then the bodies, follow one another in x from row 0.

    There is no gap, but for the coordinates of rigid bodies between the cloths and the bodies.
    """
    roles = [surface.role for surface in surfaces]
    if "cloth" not in roles:
        raise InputError("A trajectory needs at least one cloth.")
    if roles != sorted(roles, reverse=True):
        raise InputError("The cloths of a trajectory come before its bodies.")
    end, gap = 0, any(surface.rigid for surface in surfaces)
    for surface in surfaces:
        if surface.role == "body" and gap and surface.rows.start > end:
            gap, end = False, surface.rows.start
        if surface.rows.start != end or surface.rows.stop < end:
            raise InputError(f"{surface.name} has rows {surface.rows.start}..{surface.rows.stop} of x, not from {end}.")
        end = surface.rows.stop


def same_surfaces(one: Sequence[Surface], other: Sequence[Surface]) -> bool:
    """True where both have the same names, rows, triangles and motions in the same order."""

    def key(surface: Surface) -> tuple[object, ...]:
        return surface.name, surface.role, surface.n_vertices, surface.moving

    return [key(s) for s in one] == [key(s) for s in other] and all(
        np.array_equal(a.own_triangles, b.own_triangles) for a, b in zip(one, other, strict=True)
    )
