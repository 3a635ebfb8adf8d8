"""The surface that collides: cloths and bodies as one ipctk mesh, with a label that says who may touch whom."""

from dataclasses import dataclass

import ipctk
import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.mesh.world import World


@dataclass(frozen=True)
class ContactSurface:
    """`mesh`: the ipctk mesh over the first `n_surface` rows of x (cloths, then bodies); n_cloth of them are cloth."""

    mesh: ipctk.CollisionMesh
    n_cloth: int
    n_surface: int

    def rows(self, x: Floats) -> Floats:
        """The colliding rows of x in the column-major order that ipctk takes."""
        return np.asfortranarray(x[: self.n_surface])

    def intersects(self, x: Floats) -> bool:
        """True where a cloth edge crosses a body triangle or the reverse."""
        return bool(ipctk.has_intersections(self.mesh, self.rows(x), ipctk.LBVH()))


def cloth_body_surface(world: World) -> ContactSurface:
    """Cloth against bodies only: no cloth meets itself or another, and no body meets itself or another.

    ipctk weighs each pair by the areas around its vertices and edges in the rest shape that it is given. A body much
    coarser than the cloth (a slab of two triangles) would weigh a touch by its own square metres; so each such body is
    handed over shrunk at rest until its mean triangle is no larger than the cloth's. The surface itself is not changed.
    """
    n_surface = world.n_vertices - len(world.ghosts)
    rest = world.start()[:n_surface]
    for cloth, rows in zip(world.cloths, world.cloth_slices, strict=True):
        rest[rows] = cloth.rest_positions
    cloth_area = world.rest_areas.mean()
    for body, rows in zip(world.bodies, world.body_slices, strict=True):
        corners = body.positions[body.triangles]
        area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        rest[rows] = body.positions * np.sqrt(min(1.0, cloth_area / area.mean()))
    return surface_of(rest, np.concatenate([world.triangles, world.body_triangles]), world.n_cloth)


def surface_of(rest_positions: Floats, triangles: Ints, n_cloth: int) -> ContactSurface:
    """The surface of `rest_positions (n, 3)` [m] and `triangles (m, 3)`: the first n_cloth vertices against the others.

    Only the weights of the pairs need the rest positions; whether surfaces intersect does not.
    """
    faces = triangles.astype(np.int32)
    edges = ipctk.edges(np.asfortranarray(faces))
    mesh = ipctk.CollisionMesh(np.asfortranarray(rest_positions), np.asfortranarray(edges), np.asfortranarray(faces))
    labels = np.zeros(len(rest_positions), np.int32)
    labels[n_cloth:] = 1
    mesh.can_collide = ipctk.make_vertex_patches_filter(labels)
    return ContactSurface(mesh, n_cloth, len(rest_positions))
