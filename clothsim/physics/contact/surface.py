"""Contact surface: points, edges and triangles of two groups, and the pairs of objects that may touch."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.base.linalg import unit
from clothsim.base.memo import known_for_arrays
from clothsim.base.triangles import half_edges, thirds_at_vertices, triangle_areas
from clothsim.keys.typed_effects import ContactKeys
from clothsim.mesh.body import FrameMotion, PosedMotion
from clothsim.mesh.topology import interior_edges, unique_edges
from clothsim.mesh.world import World

# Flat features of a body: points and edges inside a flat face, which no contact needs.
#
# A cloth that touches a flat face touches it with its own vertices, or at the border of the face. An edge between two
# coplanar triangles, and a vertex all of whose edges are such, are features of the triangulation alone: contact with
# them would push a sheet along the face, from where such features are under it to where none are.

FLAT = 1e-5
"""Angle between two faces up to which they count as one [rad]: the round-off of files. The edge between faces of a
metre then lies at most 2.5 um from their common plane."""


@dataclass(frozen=True)
class FlatFeatures:
    """Rows of the points (p,) and of the edges (e, 2), sorted, inside flat faces."""

    points: Ints
    edges: Ints

    def shifted(self, first: int) -> "FlatFeatures":
        """The same features of a body that begins at row `first`."""
        return FlatFeatures(self.points + first, self.edges + first)


NO_FLAT_FEATURES = FlatFeatures(np.zeros(0, np.int64), np.zeros((0, 2), np.int64))


@known_for_arrays
def flat_features(positions: Floats, triangles: Ints) -> FlatFeatures:
    """Points and edges of a surface, positions (n, 3) [m] and triangles (m, 3), inside its flat faces.

    Examples
    --------
    The diagonals of a box are flat, its corners and ridges are not:

    >>> from clothsim.mesh.generators.table import GENERATORS
    >>> found = flat_features(*GENERATORS["slab"](size=(1.0, 1.0, 0.1)))
    >>> len(found.edges), len(found.points)
    (6, 0)
    """
    hinges, _ = interior_edges(triangles)
    start, end, opposite, other = (positions[column] for column in hinges.T)
    along = unit(end - start)
    arms = [corner - start for corner in (opposite, other)]  # and their parts across the edge
    inward, other_inward = (unit(arm - (arm * along).sum(axis=1, keepdims=True) * along) for arm in arms)
    flat = np.linalg.norm(inward + other_inward, axis=1) <= FLAT
    flat &= (inward != 0.0).any(axis=1)  # a face without area has no direction
    edges = np.sort(hinges[flat, :2], axis=1)
    n_edges, n_flat = (np.bincount(rows.ravel(), minlength=len(positions)) for rows in (unique_edges(triangles), edges))
    points = np.flatnonzero((n_edges > 0) & (n_edges == n_flat))
    return FlatFeatures(points, edges)


@dataclass(frozen=True)
class Primitives:
    """Points (p,), edges (e, 2) and triangles (m, 3) as rows of x."""

    points: Ints
    edges: Ints
    triangles: Ints


@dataclass(frozen=True)
class BareEdges:
    """Edges (k, 2) of no triangle, those of rods: rest lengths (k,) [m], and areas (k,) [m2], length times radius."""

    edges: Ints
    lengths: Floats
    areas: Floats


NO_BARE_EDGES = BareEdges(np.zeros((0, 2), np.int64), np.zeros(0), np.zeros(0))


@dataclass(frozen=True)
class ContactSurface:
    """Two groups of primitives; for self-contact both are the same object (`second is first`).

    Attributes
    ----------
    first, second : Primitives
        The groups.
    rest_positions : (N, 3) array
        Rest positions [m].
    rest_corners : (m, 3, 3) array
        Corners of each of `triangles` at rest [m], from which areas and lengths of pairs are computed: of a cloth
        with a flat pattern in the pattern's plane, else rest positions.
    labels : (N,) int array
        Object of each row of x.
    allowed : (L, L) bool array
        Pairs of objects that may touch.
    flat : FlatFeatures
        Points and edges of the second group inside flat faces: their pairs stop a motion, but push nothing.
    n_shared : int
        Last triangles of the first group that are in the second too (those of rigid bodies).
    bare : BareEdges
        Edges of the first group that belong to no triangle.
    """

    first: Primitives
    second: Primitives
    rest_positions: Floats
    rest_corners: Floats
    labels: Ints
    allowed: np.ndarray
    flat: FlatFeatures = NO_FLAT_FEATURES
    n_shared: int = 0
    bare: BareEdges = NO_BARE_EDGES

    @property
    def is_self_contact(self) -> bool:
        """True where the two groups are one."""
        return self.second is self.first

    @cached_property
    def triangles(self) -> Ints:
        """All triangles, (m, 3)."""
        if self.is_self_contact:
            return self.first.triangles
        return np.concatenate(
            [self.first.triangles[: len(self.first.triangles) - self.n_shared], self.second.triangles]
        )

    @cached_property
    def rows(self) -> Ints:
        """The rows of x that collide."""
        if self.is_self_contact:
            return self.first.points
        both = np.concatenate([self.first.points, self.second.points])
        return np.unique(both) if self.n_shared else both

    @cached_property
    def n_read(self) -> int:
        """Number of the first rows of x that hold all that collide: beside a body those of cloths are a tenth of x."""
        return int(self.rows.max(initial=-1)) + 1

    def read(self, x: Floats) -> Floats:
        """Those rows of x: a view."""
        return x[: self.n_read]

    @property
    def n_first(self) -> int:
        """Number of the first `rows` that are of the first group alone, each pair having one side there; else all."""
        return len(self.rows) if self.n_shared else len(self.first.points)

    @cached_property
    def vertex_areas(self) -> Floats:
        """A third of the incident rest triangles of each row of x, (N,) [m2]; half of the edges of rods."""
        count = len(self.rest_positions)
        halves = np.repeat(self.bare.areas / 2, 2)
        of_rods = np.bincount(self.bare.edges.ravel(), weights=halves, minlength=count).astype(np.float64)
        return thirds_at_vertices(self._areas, self.triangles, count) + of_rods

    def edge_areas(self, edges: Ints) -> Floats:
        """A third of the incident rest triangles of each of `edges (e, 2)`, (e,) [m2]."""
        keys, areas, _ = self._edges
        return areas[np.searchsorted(keys, self._edge_keys(edges))]

    def are_flat(self, edges: Ints) -> np.ndarray:
        """Mask (e,) of `edges (e, 2)` that lie inside a flat face."""
        return np.isin(self._edge_keys(edges), self._edge_keys(self.flat.edges))

    def rest_lengths(self, edges: Ints) -> Floats:
        """Rest lengths of `edges (e, 2)`, (e,) [m]; beside a seam of two lengths their mean."""
        keys, _, lengths = self._edges
        return lengths[np.searchsorted(keys, self._edge_keys(edges))]

    @cached_property
    def _edges(self) -> tuple[Ints, Floats, Floats]:
        """Keys of all edges, ascending, with the area [m2] and the rest length [m] of each."""
        sides = np.sort(half_edges(self.triangles), axis=1)
        keys, of_side = np.unique(self._edge_keys(sides), return_inverse=True)
        of_side = of_side.ravel()
        corners = self.rest_corners[:, [1, 2, 0]] - self.rest_corners
        totals = np.bincount(of_side, weights=np.linalg.norm(corners, axis=2).ravel()).astype(np.float64)
        areas = np.bincount(of_side, weights=np.repeat(self._areas / 3, 3)).astype(np.float64)
        lengths = totals / np.bincount(of_side)
        if len(self.bare.edges):
            keys = np.concatenate([keys, self._edge_keys(self.bare.edges)])
            order = np.argsort(keys)
            keys, areas = keys[order], np.concatenate([areas, self.bare.areas])[order]
            lengths = np.concatenate([lengths, self.bare.lengths])[order]
        return keys, areas, lengths

    def _edge_keys(self, edges: Ints) -> Ints:
        return edges[:, 0] * len(self.rest_positions) + edges[:, 1]

    @cached_property
    def _areas(self) -> Floats:
        return triangle_areas(self.rest_corners)


def cloth_body_surface(world: World, excluded: np.ndarray | None = None) -> ContactSurface:
    """Surface of cloths and rigid bodies against bodies; no other pairs of bodies touch, and no body touches itself.

    A rigid body is in both groups: `allowed` has each pair of two of them once, so that no pair is found twice.

    excluded (L, L): pairs of objects that never touch. The weight of a pair is the rest area incident to its vertices
    and edges. A body much coarser than the cloth (a slab of two triangles) would weigh a contact by its own square
    metres; so each such body is scaled down at rest until its mean triangle is no larger than the cloth's.
    """
    n = len(world.cloths)
    allowed = np.zeros((n + len(world.bodies),) * 2, bool)
    allowed[:n, n:] = allowed[n:, :n] = True
    fixed = n + len(world.prescribed_bodies)
    allowed[fixed:, n:fixed] = True
    allowed[fixed:, fixed:] = np.triu(np.ones((len(world.rigid),) * 2, bool), 1)
    rest = _rest_positions(world)
    areas = [triangle_areas(b.positions[b.triangles]) for b in world.rigid]
    if world.cloths:
        areas = [world.rest_areas, _bare(world).areas]
    cloth_area = np.concatenate(areas).mean()
    for body, rows in zip(world.bodies, world.body_slices, strict=True):
        area = triangle_areas(body.positions[body.triangles])
        rest[rows] = body.positions * np.sqrt(min(1.0, cloth_area / area.mean()))
    corners = np.concatenate([_cloth_corners(world), rest[world.body_triangles]])
    bodies = Primitives(
        np.arange(world.n_unknowns, world.n_vertices - len(world.ghosts)),
        unique_edges(world.body_triangles),
        world.body_triangles,
    )
    movers, n_shared = _movers(world), sum(len(body.triangles) for body in world.rigid)
    allowed, flat = _excluding(allowed, excluded), NO_FLAT_FEATURES
    found = [  # on the bodies that stay rigid
        flat_features(body.positions, body.triangles).shifted(rows.start)
        for body, rows in zip(world.bodies, world.body_slices, strict=True)
        if body.motion.still or not isinstance(body.motion, FrameMotion | PosedMotion)
    ]
    if found:
        flat = FlatFeatures(*(np.concatenate([getattr(each, name) for each in found]) for name in ("points", "edges")))
    return ContactSurface(movers, bodies, rest, corners, world.labels, allowed, flat, n_shared, _bare(world))


def cloth_surface(world: World, excluded: np.ndarray | None = None) -> ContactSurface:
    """Surface of all cloths against themselves and each other. excluded (L, L): pairs of objects that never touch."""
    n = len(world.cloths)
    allowed = np.zeros((n + len(world.bodies),) * 2, bool)
    allowed[:n, :n] = True
    cloths = _cloths(world)
    rest, corners = _rest_positions(world), _cloth_corners(world)
    allowed = _excluding(allowed, excluded)
    return ContactSurface(cloths, cloths, rest, corners, world.labels, allowed, bare=_bare(world))


def _bare(world: World) -> BareEdges:
    """The edges of rods."""
    if not world.rods:
        return NO_BARE_EDGES
    lengths = np.concatenate([rod.lengths for rod, _ in world.rods])
    areas = np.concatenate([rod.lengths * rod.radius for rod, _ in world.rods])
    return BareEdges(world.rod_edges, lengths, areas)


def _cloths(world: World) -> Primitives:
    return Primitives(np.arange(world.n_cloth), world.edges, world.triangles)


def _movers(world: World) -> Primitives:
    """Cloths, and rigid bodies that forces move."""
    cloths = _cloths(world)
    if not world.rigid:
        return cloths
    starts = [rows.start for rows in world.rigid_slices]
    triangles = np.concatenate([body.triangles + start for body, start in zip(world.rigid, starts, strict=True)])
    points = np.arange(starts[0], world.rigid_slices[-1].stop)
    return Primitives(
        np.concatenate([cloths.points, points]),
        np.concatenate([cloths.edges, unique_edges(triangles)]),
        np.concatenate([cloths.triangles, triangles]),
    )


def _rest_positions(world: World) -> Floats:
    rest = world.start()
    for cloth, rows in zip(world.cloths, world.cloth_slices, strict=True):
        rest[rows] = cloth.rest_positions
    return rest


def _cloth_corners(world: World) -> Floats:
    """Corners of the cloth triangles at rest, (m, 3, 3) [m].

    A sewn pattern has no flat or curved shape in space in which all of its triangles are at rest: only their own plane
    tells their areas.
    """
    corners = [np.zeros((0, 3, 3))]
    for cloth in world.cloths:
        in_plane = np.zeros((len(cloth.triangles), 3, 3))
        in_plane[:, :, :2] = cloth.material_coordinates
        corners.append(in_plane if cloth.flat else cloth.rest_positions[cloth.triangles])
    return np.concatenate(corners)


def _excluding(allowed: np.ndarray, excluded: np.ndarray | None) -> np.ndarray:
    return allowed if excluded is None else allowed & ~excluded


def excluded_pairs(world: World, keys: ContactKeys) -> np.ndarray:
    """Excluded pairs of names as an (L, L) mask over the world's objects. InputError for an unknown name."""
    table = np.zeros((len(world.names),) * 2, bool)
    for number, pair in enumerate(keys.exclude):
        if isinstance(pair, str) or not isinstance(pair, Sequence) or len(pair) != 2:
            raise InputError(f"{keys.section}.exclude[{number}] must be two names, not {pair!r}.")
        unknown = [object_name for object_name in pair if object_name not in world.names]
        if unknown:
            raise InputError(
                f"{keys.section}.exclude[{number}]: unknown object {unknown[0]!r}.",
                f"Choose from: {', '.join(world.names)}.",
            )
        a, b = (world.names.index(object_name) for object_name in pair)
        table[a, b] = table[b, a] = True
    return table
