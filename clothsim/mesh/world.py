"""World: cloths and bodies in one array of vertices, and the rest quantities that the energies need.

Rows of x: first the unknowns, which are the vertices of all cloths and the coordinates of rigid bodies; then the
vertices of all bodies, those of rigid ones last; then ghosts (behind clamped edges, see `pins`). A world far
from the origin is given a local one: round-off is then that of its size, not of its position.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.base.triangles import thirds_at_vertices
from clothsim.mesh.body import Body, FreeMotion, RigidMotion
from clothsim.mesh.cloth import Cloth, Hinges, cloth_hinges, corner_over_edge, join_hinges, stiffness_in_series
from clothsim.mesh.rigid_body import RigidBody
from clothsim.mesh.rod import Rod
from clothsim.mesh.topology import unique_edges


@dataclass(frozen=True)
class World:
    """Cloths and bodies with a common numbering.

    Parameters
    ----------
    cloths, bodies : tuple
        At least one cloth, or a rigid body. The last bodies are the surfaces of `rigid`.
    hinges : Hinges
        Those of all cloths, and of clamps.
    ghosts : (g, 3) float64
        Ghost vertices of clamps at the start [m].
    origin : (3,) float64
        Origin of all positions in the coordinates of the scene [m] (see `with_local_origin`).
    rigid : tuple of RigidBody
        Rigid bodies that forces move.
    """

    cloths: tuple[Cloth, ...]
    bodies: tuple[Body, ...]
    hinges: Hinges
    ghosts: Floats
    origin: Floats
    rigid: tuple[RigidBody, ...] = ()

    @cached_property
    def n_cloth(self) -> int:
        """Number of cloth vertices, rows 0..n_cloth-1 of x."""
        return sum(len(cloth.positions) for cloth in self.cloths)

    @cached_property
    def n_unknowns(self) -> int:
        """Number of unknown rows of x: cloth vertices, then the coordinates of rigid bodies."""
        return self.n_cloth + sum(len(body.coordinates) for body in self.rigid)

    @cached_property
    def n_vertices(self) -> int:
        """Number of rows of x: unknowns, bodies and ghosts."""
        return self.n_unknowns + sum(len(body.positions) for body in self.bodies) + len(self.ghosts)

    @cached_property
    def cloth_slices(self) -> tuple[slice, ...]:
        """The rows of x of each cloth."""
        return _slices([len(cloth.positions) for cloth in self.cloths], 0)

    @cached_property
    def body_slices(self) -> tuple[slice, ...]:
        """The rows of x of each body."""
        return _slices([len(body.positions) for body in self.bodies], self.n_unknowns)

    @cached_property
    def coordinate_slices(self) -> tuple[slice, ...]:
        """The rows of x of the coordinates of each rigid body."""
        return _slices([len(body.coordinates) for body in self.rigid], self.n_cloth)

    @cached_property
    def rods(self) -> tuple[tuple[Rod, slice], ...]:
        """The cloths that are rods, with their rows of x."""
        every = zip(self.cloths, self.cloth_slices, strict=True)
        return tuple((cloth, rows) for cloth, rows in every if isinstance(cloth, Rod))

    @cached_property
    def rod_edges(self) -> Ints:
        """Edges of all rods, which belong to no triangle, (k, 2)."""
        return np.concatenate([np.zeros((0, 2), np.int64), *(rod.edges + rows.start for rod, rows in self.rods)])

    @property
    def prescribed_bodies(self) -> tuple[Body, ...]:
        """The bodies that are not rigid ones moved by forces."""
        return self.bodies[: len(self.bodies) - len(self.rigid)]

    @cached_property
    def rigid_slices(self) -> tuple[slice, ...]:
        """The rows of x of the surface of each rigid body."""
        return self.body_slices[len(self.bodies) - len(self.rigid) :]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the cloths, then of the bodies."""
        return (*(cloth.name for cloth in self.cloths), *(body.name for body in self.bodies))

    @cached_property
    def labels(self) -> Ints:
        """Number in `names` of the object of each row of x, (N,); -1 for a ghost and for a rigid body's coordinates."""
        labels = np.full(self.n_vertices, -1)
        for number, rows in enumerate((*self.cloth_slices, *self.body_slices)):
            labels[rows] = number
        return labels

    @cached_property
    def triangles(self) -> Ints:
        """All cloth triangles in world numbering, (m, 3)."""
        offsets = [rows.start for rows in self.cloth_slices]
        faces = [cloth.triangles + k for cloth, k in zip(self.cloths, offsets, strict=True)]
        return np.concatenate([np.zeros((0, 3), np.int64), *faces])

    @cached_property
    def body_triangles(self) -> Ints:
        """All body triangles in world numbering, (k, 3)."""
        offsets = [rows.start for rows in self.body_slices]
        faces = [body.triangles + k for body, k in zip(self.bodies, offsets, strict=True)]
        return np.concatenate([np.zeros((0, 3), np.int64), *faces])

    @cached_property
    def edges(self) -> Ints:
        """All edges of cloths and rods, (e, 2)."""
        return np.concatenate([unique_edges(self.triangles), self.rod_edges])

    @cached_property
    def cell(self) -> float:
        """Median length of the edges of the cloths at rest, without cloth of the rigid bodies [m]."""
        if not self.cloths:
            ends = np.concatenate([body.positions[unique_edges(body.triangles)] for body in self.rigid])
            return float(np.median(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)))
        sizes = np.linalg.norm(self.rest_shapes, axis=1)  # columns are two edges of each triangle
        return float(np.median(np.concatenate([sizes.ravel(), *(rod.lengths for rod, _ in self.rods)])))

    @property
    def material_coordinates(self) -> Floats:
        """Corners of each triangle at rest in its own plane, (m, 3, 2) [m]."""
        return np.concatenate([np.zeros((0, 3, 2)), *(cloth.material_coordinates for cloth in self.cloths)])

    @cached_property
    def rest_shapes(self) -> Floats:
        """Dm = [e1 e2] of each triangle at rest, (m, 2, 2) [m]; its columns are the reference edges."""
        corners = self.material_coordinates
        return np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=2)

    @cached_property
    def rest_shape_inverses(self) -> Floats:
        """Dm^-1, (m, 2, 2) [1/m]."""
        return np.asarray(np.linalg.inv(self.rest_shapes), np.float64)

    @cached_property
    def rest_areas(self) -> Floats:
        """Reference area of each triangle, (m,) [m2]."""
        return np.asarray(0.5 * np.abs(np.linalg.det(self.rest_shapes)), np.float64)

    @cached_property
    def masses(self) -> Floats:
        """Lumped masses of the cloth vertices, (n_cloth,) [kg]: a third of each triangle to each corner."""
        masses = thirds_at_vertices(self.per_triangle("density") * self.rest_areas, self.triangles, self.n_cloth)
        for rod, rows in self.rods:
            masses[rows] = rod.mass_per_length * rod.vertex_lengths
        return masses

    @cached_property
    def inertial_masses(self) -> Floats:
        """Masses of all unknowns in the kinetic energy, (n_unknowns,) [kg]."""
        return np.concatenate([self.masses, *(body.masses for body in self.rigid)])

    @cached_property
    def weighing_masses(self) -> Floats:
        """Masses of all unknowns on which gravity acts, (n_unknowns,) [kg]."""
        return np.concatenate([self.masses, *(body.weighing for body in self.rigid)])

    @cached_property
    def vertex_areas(self) -> Floats:
        """Reference area of each cloth vertex, (n_cloth,) [m2]; of a rod its length times the radius."""
        areas = thirds_at_vertices(self.rest_areas, self.triangles, self.n_cloth)
        for rod, rows in self.rods:
            areas[rows] = rod.radius * rod.vertex_lengths
        return areas

    def per_triangle(self, property_name: str) -> Floats:
        """Return a property of each triangle's fabric, (m,): "density", "shear_modulus", "thickness", ..."""
        return np.concatenate([np.zeros(0), *(cloth.per_triangle(property_name) for cloth in self.cloths)])

    def start(self) -> Floats:
        """Return the positions of every vertex at time 0, (N, 3) [m]."""
        cloth = [c.positions for c in self.cloths]
        rigid = [body.coordinates for body in self.rigid]
        return np.concatenate([*cloth, *rigid, *(body.at(0.0) for body in self.bodies), self.ghosts])

    def moved(self) -> Floats:
        """Return the vertices of the cloths at the start, without cloth those of the rigid bodies, (k, 3) [m]."""
        if self.cloths:
            return self.start()[: self.n_cloth]
        return np.concatenate([body.positions for body in self.rigid])

    def start_velocities(self) -> Floats:
        """Return the velocities of every row at time 0, (N, 3) [m/s]; 0 for ghosts and bodies that are not rigid."""
        velocities = np.zeros((self.n_vertices, 3))
        for cloth, rows in zip(self.cloths, self.cloth_slices, strict=True):
            velocities[rows] = cloth.velocity
        for body, rows, surface in zip(self.rigid, self.coordinate_slices, self.rigid_slices, strict=True):
            velocities[rows] = body.velocities
            velocities[surface] = body.weights @ body.velocities
        return velocities


def make_world(cloths: Sequence[Cloth], bodies: Sequence[Body] = (), rigid: Sequence[RigidBody] = ()) -> World:
    """Make a world of at least one cloth or rigid body; `bodies` without the surfaces of `rigid`, which are added.

    Raises
    ------
    InputError
        Where there is neither, or two objects share a name.
    """
    if not cloths and not rigid:
        raise InputError("The scene has no cloth.", "Add a [cloth] table with a mesh, a [[rigid]] body or a [[rod]].")
    bodies = [*bodies, *(Body(body.name, body.positions, body.triangles, FreeMotion()) for body in rigid)]
    names = [cloth.name for cloth in cloths] + [body.name for body in bodies]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise InputError(f"Two objects are named {twice!r}.", "Give each cloth and body a name of its own.")
    offsets = np.cumsum([0] + [len(cloth.positions) for cloth in cloths])
    parts = [cloth_hinges(cloth, offset) for cloth, offset in zip(cloths, offsets[:-1], strict=True)]
    return World(tuple(cloths), tuple(bodies), join_hinges(parts), np.zeros((0, 3)), np.zeros(3), tuple(rigid))


def with_material(world: World, cloths: Sequence[Cloth]) -> World:
    """Return the world with other fabrics, or other sizes of the triangles at rest, and the hinges that follow.

    Parameters
    ----------
    world : World
        Also one with clamps, whose ghosts mirror the triangles as they were.
    cloths : sequence of Cloth
        Its cloths with other fabrics or `material_coordinates`.
    """
    changed, hinges = replace(world, cloths=tuple(cloths)), world.hinges
    vertices = np.where(hinges.vertices < world.n_cloth, hinges.vertices, hinges.vertices[:, 2:3])  # ghosts mirror
    n, triangles, coordinates = max(world.n_cloth, 1), changed.triangles, changed.material_coordinates
    radix = np.array([n * n, n, 1])
    numbers = np.sort(triangles, axis=1) @ radix
    order = np.argsort(numbers)
    corners, beside = np.zeros_like(hinges.corners), np.zeros((len(vertices), 2), np.int64)
    for side, sign in ((0, 1.0), (1, -1.0)):
        wanted = np.sort(vertices[:, [0, 1, 2 + side]], axis=1) @ radix
        beside[:, side] = order[np.searchsorted(numbers, wanted, sorter=order)]
        length, along, height = corner_over_edge(triangles, coordinates, vertices, beside[:, side], side)
        corners[:, 1, 0] += 0.5 * length
        corners[:, 2 + side, 0], corners[:, 2 + side, 1] = along, sign * height
    heights = np.stack([corners[:, 2, 1], -corners[:, 3, 1]], axis=1)
    stiffness = stiffness_in_series(changed.per_triangle("bending_stiffness")[beside], heights)
    clamped = np.where(hinges.held >= 0, 2.0, 1.0)  # see the effect `pins`
    return replace(changed, hinges=replace(hinges, corners=corners, stiffness=clamped * stiffness))


def _slices(sizes: Sequence[int], start: int) -> tuple[slice, ...]:
    ends = start + np.cumsum([0, *sizes])
    return tuple(slice(int(a), int(b)) for a, b in zip(ends[:-1], ends[1:], strict=True))


NO_EDGES: Ints = np.zeros((0, 2), np.int64)


@dataclass(frozen=True)
class SurfaceRows:
    """A cloth or body.

    rows: of x; triangles (m, 3): in rows of x; moving: False where its positions are the same in all frames; rigid:
    True for a rigid body that forces move; edges (k, 2), radius [m]: of a rod, in rows of x, in order along it.
    """

    name: str
    role: Literal["cloth", "body"]
    rows: slice
    triangles: Ints
    moving: bool
    rigid: bool = False
    edges: Ints = field(default_factory=lambda: NO_EDGES)
    radius: float = 0.0

    @property
    def n_vertices(self) -> int:
        """Number of vertices."""
        return self.rows.stop - self.rows.start

    @property
    def own_triangles(self) -> Ints:
        """The triangles counted from the surface's own first vertex, (m, 3)."""
        return self.triangles - self.rows.start


def world_surfaces(world: World) -> tuple[SurfaceRows, ...]:
    """The surfaces of a world in the order of its rows of x: cloths, then bodies."""
    cloths = []
    for cloth, rows in zip(world.cloths, world.cloth_slices, strict=True):
        line: dict[str, Any] = {}
        if isinstance(cloth, Rod):
            line = {"edges": cloth.edges + rows.start, "radius": cloth.radius}
        cloths.append(SurfaceRows(cloth.name, "cloth", rows, cloth.triangles + rows.start, True, **line))
    prescribed = len(world.prescribed_bodies)
    bodies = [
        SurfaceRows(
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


def check_surfaces(surfaces: Sequence[SurfaceRows]) -> None:
    """InputError unless cloths, then bodies, at least one of them cloth or rigid, follow one another in x from row 0.

    There is no gap, but for the coordinates of rigid bodies between the cloths and the bodies.
    """
    roles = [surface.role for surface in surfaces]
    if "cloth" not in roles and not any(surface.rigid for surface in surfaces):
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


def same_surfaces(one: Sequence[SurfaceRows], other: Sequence[SurfaceRows]) -> bool:
    """True where both have the same names, rows, triangles and motions in the same order."""

    def key(surface: SurfaceRows) -> tuple[object, ...]:
        return surface.name, surface.role, surface.n_vertices, surface.moving

    return [key(s) for s in one] == [key(s) for s in other] and all(
        np.array_equal(a.own_triangles, b.own_triangles) for a, b in zip(one, other, strict=True)
    )


FAR = 100.0
"""Distance from the origin, in sizes of the cloth, from which on a world gets a local origin."""

COARSEST = 1e-6
"""Spacing of the coordinates in double precision, in sizes of the cloth, from which on a world is refused: neither its
meshes nor its frames could hold the shape."""


def with_local_origin(world: World) -> World:
    """Return the world relative to the centre of what moves, with `origin` set; unchanged where that is near.

    InputError where it is so far that coordinates there do not resolve the cloth.
    """
    moved = world.moved()
    low, high = moved.min(axis=0), moved.max(axis=0)
    middle = 0.5 * (low + high)
    if math.hypot(*middle) <= FAR * math.hypot(*(high - low)):
        return world
    size, far = math.hypot(*(high - low)), float(np.abs(middle).max())
    spacing = float(np.spacing(far))
    if spacing > COARSEST * size:
        name = world.cloths[0].name if world.cloths else world.rigid[0].name
        raise InputError(
            f"{name} is {far:.2g} m from the origin, where double precision tells "
            f"only points {spacing:.2g} m apart; {'the cloth' if world.cloths else 'it'} is {size:.2g} m long.",
            "Move cloths and bodies near the origin (position).",
        )
    cloths = tuple(replace(each, positions=each.positions - middle) for each in world.cloths)
    bodies = []
    for body in world.bodies:
        motion = body.motion
        if isinstance(motion, RigidMotion):
            motion = replace(motion, centre=motion.centre - middle)
        bodies.append(replace(body, positions=body.positions - middle, motion=motion))
    rigid = tuple(body.relative_to(middle) for body in world.rigid)
    return replace(world, cloths=cloths, bodies=tuple(bodies), rigid=rigid, origin=world.origin + middle)
