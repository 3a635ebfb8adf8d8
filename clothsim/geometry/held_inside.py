"""Pieces of cloth that lie inside a body: contact keeps them there, where it is on.

The winding number tells whether a body contains a point, exactly for closed surfaces however they overlap.
"""

from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.jit import kernel
from clothsim.base.vectors import cross, dot, length, minus, row
from clothsim.mesh.cloth import Cloth
from clothsim.mesh.topology import components
from clothsim.mesh.world import World


@kernel
def winding_number(point: Floats, positions: Floats, triangles: Ints) -> float:
    """Return the winding number of `triangles (m, 3)` about `point (3,)`: 1 inside, 0 outside, fractional near holes.

    The sum of the triangles' solid angles over 4 pi (Van Oosterom & Strackee 1983, eq. 8; Jacobson et al. 2013).
    """
    at, half = (point[0], point[1], point[2]), 0.0
    for t in range(len(triangles)):
        a, b, c = (
            minus(row(positions, triangles[t, 0]), at),
            minus(row(positions, triangles[t, 1]), at),
            minus(row(positions, triangles[t, 2]), at),
        )
        la, lb, lc = length(a), length(b), length(c)
        half += np.arctan2(dot(a, cross(b, c)), la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb)
    return half / (2 * np.pi)


def is_inside(point: Floats, positions: Floats, triangles: Ints) -> bool:
    """Return True where `point (3,)` is inside a body of either winding."""
    return abs(winding_number(point, positions, triangles)) > 0.5


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
    touch : bool
        False for a rod in a rigid body: contact does not know these pairs.
    """

    cloth: str
    body: str
    pieces: int
    of: int
    vertex: int
    touch: bool = True

    @property
    def where(self) -> str:
        """Which pieces, and a vertex of them."""
        pieces = "all of it" if self.of == 1 else f"{self.pieces} of its {self.of} pieces"
        return f"{pieces}, such as vertex {self.vertex}"


def _labels(cloth: Cloth) -> Ints:
    """Number of the connected piece of each vertex, (n,); a rod is one piece."""
    n = len(cloth.positions)
    return components(cloth.triangles, n) if len(cloth.triangles) else np.zeros(n, np.int64)


def first_vertices(cloth: Cloth) -> Ints:
    """First vertex of each connected piece of a cloth, (p,); a rod is one piece."""
    return np.asarray(np.unique(_labels(cloth), return_index=True)[1], np.int64)


DIRECTIONS = np.array([[x, y, z] for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1)], float)


def held_inside(world: World, x: Floats) -> list[HeldInside]:
    """Pieces of cloth inside a body at x (N, 3) [m]: the first vertex and those farthest out in 26 directions are.

    Of a piece that does not intersect the body the first tells for all; one that passes through has others outside.
    """
    found, rigid = [], {body.name for body in world.rigid}
    for cloth, rows in zip(world.cloths, world.cloth_slices, strict=True):
        labels, firsts, points = _labels(cloth), first_vertices(cloth), x[rows]
        for body, body_rows in zip(world.bodies, world.body_slices, strict=True):
            inside = []
            for first in firsts:
                piece = points[labels == labels[first]]
                examined = [points[first], *piece[np.unique((piece @ DIRECTIONS.T).argmax(axis=0))]]
                if all(is_inside(point, x[body_rows], body.triangles) for point in examined):
                    inside.append(int(first))
            if inside:
                touch = bool(len(cloth.triangles)) or body.name not in rigid
                found.append(HeldInside(cloth.name, body.name, len(inside), len(firsts), inside[0], touch))
    return found
