"""Linear interpolation of material points between meshes."""

from collections.abc import Sequence
from dataclasses import dataclass

import igl
import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.triangles import barycentric as weights_in
from clothsim.base.triangles import thirds_at_vertices, triangle_areas
from clothsim.engine import World


@dataclass(frozen=True)
class Material:
    """The cloths of a run: rest positions (n, 3) [m] and triangles (m, 3) of each, in the order of its vertices."""

    rest: tuple[Floats, ...]
    triangles: tuple[Ints, ...]

    def same_as(self, other: "Material") -> bool:
        """True where the vertices are the same points of the material."""
        pairs = zip(self.rest, other.rest, strict=True)
        return all(one.shape == another.shape and np.array_equal(one, another) for one, another in pairs)


def material_of(rest: Sequence[Floats], triangles: Sequence[Ints]) -> Material:
    """A material of several cloths."""
    return Material(tuple(rest), tuple(triangles))


def world_material(world: World) -> Material:
    """The cloths of a world at rest."""
    return material_of([each.rest_positions for each in world.cloths], [each.triangles for each in world.cloths])


def nearest_weights(points: Floats, rest: Floats, triangles: Ints) -> tuple[Ints, Floats]:
    """For each of `points (k, 3)` [m] the nearest triangle (k,) of a mesh at rest, and its weights (k, 3).

    The weights are those of the point's foot on the plane of the triangle, and may be negative at a border that is
    coarser than the point's own: a linear function of the material is interpolated exactly.
    """
    _, nearest, _ = igl.point_mesh_squared_distance(points, rest, triangles)
    return nearest, weights_in(rest[triangles[nearest]], points)


def at_points_of(base: Material, run: Material, positions: Floats) -> Floats:
    """Positions of the vertices of `base` in a run whose vertices are at `positions (n, 3)` [m]."""
    if run.same_as(base):
        return positions
    starts = np.cumsum([0, *(len(rest) for rest in run.rest)])
    parts = []
    for points, rest, triangles, first in zip(base.rest, run.rest, run.triangles, starts[:-1], strict=True):
        nearest, weights = nearest_weights(points, rest, triangles)
        parts.append(np.einsum("ij,ijk->ik", weights, positions[first + triangles[nearest]]))
    return np.concatenate(parts)


def point_areas(material: Material) -> Floats:
    """The area that each vertex stands for: a third of that of its triangles at rest, (n,) [m2]."""
    return np.concatenate(
        [
            thirds_at_vertices(triangle_areas(rest[triangles]), triangles, len(rest))
            for rest, triangles in zip(material.rest, material.triangles, strict=True)
        ]
    )
