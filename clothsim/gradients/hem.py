"""Hem of a cloth: the side of its border that hangs lowest.

The border is cut into sides at its corners, where the angles of the triangles at a vertex sum to half a turn less or
more than CORNER, whatever the shape of the cloth in space.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.gradients.losses import Height, Loss
from clothsim.mesh.topology import border_edges
from clothsim.mesh.world import World

CORNER = np.pi / 4
"""Turn of the border within the cloth from which a vertex is a corner [rad]."""


@dataclass(frozen=True)
class Hem(Loss):
    """Mean height of the side of the border that is lowest [m].

    Parameters
    ----------
    sides : tuple of (k,) int arrays
        Vertices of the sides, as of `border_sides`.
    frame : int
        The frame.
    """

    sides: tuple[Ints, ...]
    frame: int = -1

    def evaluate(self, positions: Floats, triangles: Ints) -> tuple[float, Floats]:
        """Return the least mean z of a side and 1/k in its rows. InputError without a border."""
        if not self.sides:
            raise InputError("The cloth has no border, and so no hem.", "Take another loss, such as height.")
        lowest = min(self.sides, key=lambda side: float(positions[side, 2].mean()))
        return Height(lowest).evaluate(positions, triangles)


def hem_of(world: World) -> Hem:
    """Return the loss of a scene's cloths: the lowest side of all their borders."""
    rest = np.concatenate([cloth.rest_positions for cloth in world.cloths])
    return Hem(border_sides(rest, world.triangles))


def border_sides(rest: Floats, triangles: Ints) -> tuple[Ints, ...]:
    """Return the vertices of each side of a border.

    Parameters
    ----------
    rest : (n, 3) float64
        Rest positions [m].
    triangles : (m, 3) int64
        Triangles.

    Returns
    -------
    tuple of (k,) int64 arrays
        Corners belong to both of their sides; a loop without corners is one side.

    Examples
    --------
    >>> from clothsim.mesh.generators.sheets import rectangle
    >>> [len(side) for side in border_sides(*rectangle(cells=(4, 2)))]
    [5, 3, 5, 3]
    """
    edges = border_edges(triangles)[0]
    corners = rest[triangles]
    u, v = (np.roll(corners, -k, axis=1) - corners for k in (1, 2))
    angles = np.arctan2(np.linalg.norm(np.cross(u, v), axis=2), (u * v).sum(axis=2))
    turns = np.abs(np.pi - np.bincount(triangles.ravel(), angles.ravel(), len(rest)).astype(np.float64))
    at, ends = np.nonzero(turns[edges] <= CORNER)
    n = len(edges)
    graph = coo_array((np.ones(len(at)), (at, n + edges[at, ends])), shape=(n + len(rest),) * 2)
    labels = connected_components(graph, directed=False)[1][:n]
    return tuple(np.unique(edges[labels == label]) for label in np.unique(labels))
