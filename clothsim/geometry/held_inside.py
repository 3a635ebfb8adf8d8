"""Pieces of cloth that lie inside a body: contact keeps them there."""

from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.mesh.cloth import Cloth
from clothsim.mesh.topology import components
from clothsim.mesh.winding import is_inside
from clothsim.mesh.world import World


@dataclass(frozen=True)
class HeldInside:
    """Pieces of a cloth inside a body.

    Parameters
    ----------
    cloth, body : str
        Names.
    pieces, of : int
        Number of connected pieces inside, and of all.
    vertex : int
        A vertex of the first of them.
    """

    cloth: str
    body: str
    pieces: int
    of: int
    vertex: int

    @property
    def where(self) -> str:
        """Which pieces, and a vertex of them."""
        pieces = "all of it" if self.of == 1 else f"{self.pieces} of its {self.of} pieces"
        return f"{pieces}, such as vertex {self.vertex}"


def first_vertices(cloth: Cloth) -> Ints:
    """First vertex of each connected piece of a cloth, (p,); a rod is one piece."""
    if not len(cloth.triangles):
        return np.zeros(1, np.int64)
    return np.asarray(np.unique(components(cloth.triangles, len(cloth.positions)), return_index=True)[1], np.int64)


def held_inside(world: World, x: Floats) -> list[HeldInside]:
    """Pieces of cloth inside a body at x (N, 3) [m], which must not intersect: one vertex of a piece tells for it."""
    found = []
    for cloth, rows in zip(world.cloths, world.cloth_slices, strict=True):
        firsts = first_vertices(cloth)
        for body, body_rows in zip(world.bodies, world.body_slices, strict=True):
            points = x[rows]
            inside = [int(row) for row in firsts if is_inside(points[row], x[body_rows], body.triangles)]
            if inside:
                found.append(HeldInside(cloth.name, body.name, len(inside), len(firsts), inside[0]))
    return found
