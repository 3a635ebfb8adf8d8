"""Carried vertices: cloth vertices that follow a triangle of a body while two of its parts close on them."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.mesh.world import World
from clothsim.physics.energies.constraint import Constraint, Prescribed

MEMORY = "contact.pinch"
"""Name of the carried vertices in `State.memory`."""
WIDENING = "contact.pinch.widening"
"""Name of the factor on the gap of a pinch in `State.memory`."""


@dataclass(frozen=True)
class Carried:
    """Carried vertices and where each is on its triangle.

    Parameters
    ----------
    vertices : (k,) int array
        Rows of x, ascending.
    triangles : (k, 3) int array
        Rows of x of the body triangle that carries each.
    weights : (k, 3) array
        Weights of its corners, at the point to which the offset belongs.
    offsets : (k, 3) array
        From that point to the vertex, in the frame of the triangle: two tangents and the normal [m].
    far : (k, 3) int array
        Rows of x of the body triangle that closed on the vertex from the other side.
    far_weights : (k, 3) array
        Weights of its corners, at the point that did.
    """

    vertices: Ints
    triangles: Ints
    weights: Floats
    offsets: Floats
    far: Ints
    far_weights: Floats

    def __len__(self) -> int:
        return len(self.vertices)

    def points(self, x: Floats) -> Floats:
        """Points of the triangles at x (N, 3), (k, 3) [m]."""
        return np.asarray(np.einsum("kc,kcd->kd", self.weights, x[self.triangles]))

    def positions(self, x: Floats) -> Floats:
        """Positions of the vertices where the bodies are as in x (N, 3), (k, 3) [m]."""
        return self.points(x) + np.einsum("kc,kcd->kd", self.offsets, frames(x, self.triangles))

    def far_heights(self, x: Floats) -> Floats:
        """Heights of the far points above the triangles at x (N, 3), (k,) [m]; negative where the parts crossed."""
        far = np.einsum("kc,kcd->kd", self.far_weights, x[self.far])
        return np.asarray(np.einsum("kd,kd->k", far - self.points(x), normals(x, self.triangles)))

    def only(self, chosen: np.ndarray) -> Self:
        """Those of a mask or of indices."""
        return type(self)(*(each[chosen] for each in self._parts))

    def joined(self, other: Self) -> Self:
        """Both, by ascending vertices; they have none in common."""
        joined = type(self)(*(np.concatenate(two) for two in zip(self._parts, other._parts, strict=True)))
        return joined.only(np.argsort(joined.vertices))

    def mask(self, size: int) -> np.ndarray:
        """The vertices as a mask over the rows of x, (N,)."""
        mask = np.zeros(size, bool)
        mask[self.vertices] = True
        return mask

    def raised(self, by: Floats) -> Self:
        """Further along the normals of the triangles, by (k,) [m]."""
        offsets = self.offsets.copy()
        offsets[:, 2] += by
        return replace(self, offsets=offsets)

    def as_array(self) -> Floats:
        """One row a vertex, (k, 16), as a checkpoint keeps it."""
        return np.column_stack(self._parts).astype(np.float64)

    @property
    def _parts(self) -> tuple[Any, ...]:
        return self.vertices, self.triangles, self.weights, self.offsets, self.far, self.far_weights


def carried_in(memory: Mapping[str, Any]) -> Carried:
    """Return the carried vertices that a state remembers."""
    rows = np.asarray(memory.get(MEMORY, ()), np.float64).reshape(-1, 16)
    whole = rows.astype(np.int64)
    return Carried(whole[:, 0], whole[:, 1:4], rows[:, 4:7], rows[:, 7:10], whole[:, 10:13], rows[:, 13:])


NONE_CARRIED = carried_in({})


def attached(x: Floats, vertices: Ints, near: tuple[Ints, Floats], far: tuple[Ints, Floats]) -> Carried:
    """Return the vertices carried from where they are in x (N, 3) [m].

    near, far: triangles (k, 3) that carry them and that close on them, and the weights (k, 3) of a point of each.
    """
    triangles, weights = near
    points = np.einsum("kc,kcd->kd", weights, x[triangles])
    offsets = np.einsum("kd,kcd->kc", x[vertices] - points, frames(x, triangles))
    return Carried(vertices, triangles, weights, offsets, *far)


def frames(x: Floats, triangles: Ints) -> Floats:
    """Orthonormal frames of triangles (k, 3), (k, 3, 3): its rows are the first edge, the other tangent, the normal."""
    corners = x[triangles]
    tangent, normal = corners[:, 1] - corners[:, 0], normals(x, triangles)
    tangent = tangent / np.linalg.norm(tangent, axis=1, keepdims=True)
    return np.stack([tangent, np.cross(normal, tangent), normal], axis=1)


def normals(x: Floats, triangles: Ints) -> Floats:
    """Unit normals of triangles (k, 3), (k, 3)."""
    corners = x[triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.asarray(normal / np.linalg.norm(normal, axis=1, keepdims=True))


def with_bodies(world: World, x: Floats, time: float) -> Floats:
    """Return x (N, 3) with the bodies where they are at `time` [s]."""
    moved = x.copy()
    for body, rows in zip(world.bodies, world.body_slices, strict=True):
        if not body.motion.still:
            moved[rows] = body.at(time)
    return moved


@dataclass(frozen=True)
class CarriedVertices(Constraint):
    """Dirichlet positions of carried vertices: those of their triangles at the time, and their offsets."""

    world: World
    carried: Carried

    @property
    def still(self) -> bool:
        """False: the body moves."""
        return False

    def at(self, time: float) -> Prescribed:
        """The carried vertices and their positions at `time` [s]."""
        bodies = with_bodies(self.world, self.world.start(), time)
        return Prescribed(self.carried.vertices, self.carried.positions(bodies))

    def holder(self, row: int) -> str:
        """The key of the scene, for a carried row."""
        return "contact.pinch" if row in self.carried.vertices else ""
