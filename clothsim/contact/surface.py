"""The surface that collides: points, edges and triangles of two groups, and who of them may touch whom."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.mesh.topology import unique_edges
from clothsim.mesh.world import World


@dataclass(frozen=True)
class Primitives:
    """Points (p,), edges (e, 2) and triangles (m, 3) as rows of x."""

    points: Ints
    edges: Ints
    triangles: Ints


@dataclass(frozen=True)
class ContactSurface:
    """Two groups of primitives; cloth that meets itself is both groups at once (`second is first`).

    triangles (m, 3): all of them; rest_positions (N, 3) [m]: give the pairs their areas; labels (N,): the object that
    each row of x belongs to; allowed (L, L): which objects may touch.
    """

    first: Primitives
    second: Primitives
    rest_positions: Floats
    labels: Ints
    allowed: np.ndarray

    @property
    def itself(self) -> bool:
        """True where the two groups are one."""
        return self.second is self.first

    @property
    def complete(self) -> bool:
        """True where no pair of objects of the two groups is left out."""
        first, second = np.unique(self.labels[self.first.points]), np.unique(self.labels[self.second.points])
        return bool(self.allowed[np.ix_(first, second)].all())

    @cached_property
    def triangles(self) -> Ints:
        """All triangles, (m, 3)."""
        if self.itself:
            return self.first.triangles
        return np.concatenate([self.first.triangles, self.second.triangles])

    @cached_property
    def rows(self) -> Ints:
        """The rows of x that collide."""
        return self.first.points if self.itself else np.concatenate([self.first.points, self.second.points])

    @cached_property
    def vertex_areas(self) -> Floats:
        """A third of the rest triangles around each row of x, (N,) [m2]."""
        thirds, count = np.repeat(self._areas / 3, 3), len(self.rest_positions)
        return np.bincount(self.triangles.ravel(), weights=thirds, minlength=count).astype(np.float64)

    def edge_areas(self, edges: Ints) -> Floats:
        """A third of the rest triangles on each of `edges (e, 2)`, (e,) [m2]."""
        size = len(self.rest_positions)
        sides = np.sort(self.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        keys, inverse = np.unique(sides[:, 0] * size + sides[:, 1], return_inverse=True)
        totals = np.bincount(inverse.ravel(), weights=np.repeat(self._areas / 3, 3)).astype(np.float64)
        return totals[np.searchsorted(keys, edges[:, 0] * size + edges[:, 1])]

    def rest_lengths(self, edges: Ints) -> Floats:
        """Lengths at rest of `edges (e, 2)`, (e,) [m]."""
        ends = self.rest_positions[edges]
        return np.asarray(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), np.float64)

    @cached_property
    def _areas(self) -> Floats:
        return triangle_areas(self.rest_positions, self.triangles)


def cloth_body_surface(world: World, excluded: np.ndarray | None = None) -> ContactSurface:
    """Cloths against bodies: no cloth meets itself or another, and no body meets itself or another.

    excluded (L, L): pairs of objects that never touch. A pair weighs by the areas around its vertices and edges at
    rest. A body much coarser than the cloth (a slab of two triangles) would weigh a touch by its own square metres; so
    each such body counts as shrunk at rest until its mean triangle is no larger than the cloth's.
    """
    n = len(world.cloths)
    allowed = np.zeros((n + len(world.bodies),) * 2, bool)
    allowed[:n, n:] = allowed[n:, :n] = True
    rest = _rest_positions(world)
    cloth_area = world.rest_areas.mean()
    for body, rows in zip(world.bodies, world.body_slices, strict=True):
        area = triangle_areas(body.positions, body.triangles)
        rest[rows] = body.positions * np.sqrt(min(1.0, cloth_area / area.mean()))
    bodies = Primitives(
        np.arange(world.n_cloth, world.n_vertices - len(world.ghosts)),
        unique_edges(world.body_triangles),
        world.body_triangles,
    )
    return ContactSurface(_cloths(world), bodies, rest, world.labels, _without(allowed, excluded))


def cloth_surface(world: World, excluded: np.ndarray | None = None) -> ContactSurface:
    """Every cloth against itself and the others. excluded (L, L): pairs of objects that never touch."""
    n = len(world.cloths)
    allowed = np.zeros((n + len(world.bodies),) * 2, bool)
    allowed[:n, :n] = True
    cloths = _cloths(world)
    return ContactSurface(cloths, cloths, _rest_positions(world), world.labels, _without(allowed, excluded))


def triangle_areas(positions: Floats, triangles: Ints) -> Floats:
    """The area of each triangle, (m,) [m2]."""
    corners = positions[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.asarray(0.5 * np.linalg.norm(normals, axis=1), np.float64)


def _cloths(world: World) -> Primitives:
    return Primitives(np.arange(world.n_cloth), world.edges, world.triangles)


def _rest_positions(world: World) -> Floats:
    rest = world.start()
    for cloth, rows in zip(world.cloths, world.cloth_slices, strict=True):
        rest[rows] = cloth.rest_positions
    return rest


def _without(allowed: np.ndarray, excluded: np.ndarray | None) -> np.ndarray:
    return allowed if excluded is None else allowed & ~excluded
