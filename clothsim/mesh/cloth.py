"""Cloth: start positions, the rest shape of its material, and the hinges about which it bends."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields

import numpy as np

from clothsim.base.arrays import Floats, Ints, as_points, as_triangles
from clothsim.base.errors import InputError
from clothsim.keys.fabric import Fabric
from clothsim.mesh.topology import interior_edges


@dataclass(frozen=True)
class PatternLines:
    """Vertices of a cloth by their names in its pattern.

    Attributes
    ----------
    edges : mapping of (str, int) to (k,) int array
        Vertices of each edge of a panel, from its start to its end.
    labels : mapping of str to tuple of (str, int)
        Edges of each label, such as "lower_interface".
    open_seams : mapping of str to (k, 2) int array
        Vertices that a seam joins, where it is not welded yet.
    """

    edges: Mapping[tuple[str, int], Ints] = field(default_factory=dict)
    labels: Mapping[str, tuple[tuple[str, int], ...]] = field(default_factory=dict)
    open_seams: Mapping[str, Ints] = field(default_factory=dict)

    def labelled(self, label: str) -> Ints:
        """Vertices of all edges of a label, (k,), ascending."""
        return np.unique(np.concatenate([self.edges[name] for name in self.labels[label]]))

    def segments(self, names: Iterable[tuple[str, int]]) -> Ints:
        """Neighbouring vertices along edges of panels, (k, 2); a pair of two edges that are welded comes twice."""
        sides = [self.edges[name] for name in names]
        return np.concatenate([np.zeros((0, 2), np.int64), *(np.column_stack([s[:-1], s[1:]]) for s in sides)])

    def renumbered(self, number: Ints) -> "PatternLines":
        """Copy in which vertex i has become number[i], or has gone where that is -1."""
        pairs = {name: number[rows] for name, rows in self.open_seams.items()}
        pairs = {name: rows[(rows >= 0).all(axis=1) & (rows[:, 0] != rows[:, 1])] for name, rows in pairs.items()}
        return PatternLines(
            {name: new[new >= 0] for name, new in ((name, number[rows]) for name, rows in self.edges.items())},
            self.labels,
            {name: rows for name, rows in pairs.items() if len(rows)},
        )


@dataclass(frozen=True)
class Cloth:
    """One sheet, of one fabric unless its panels have their own.

    Parameters
    ----------
    name : str
        Name in the scene.
    positions : (n, 3) float64
        Start positions [m].
    triangles : (m, 3) int64
        Vertex indices.
    material_coordinates : (m, 3, 2) float64
        Corners of each triangle at rest in its own plane [m].
    rest_positions : (n, 3) float64
        Shape whose hinge angles are the rest angles [m] (for a flat pattern: see `flat`).
    flat : bool
        True where the rest shape is a flat pattern, so that every rest angle is zero.
    fabric : Fabric
        Material.
    velocity : (3,) float64
        Velocity at the start [m/s].
    groups : mapping
        Triangles of each panel that the mesh names.
    texture : (m, 3, 2) or (0, 3, 2) float64
        Texture coordinates of each corner, where the mesh has them; no energy reads them.
    fabrics : mapping
        Material of the panels that have one of their own; the others are of `fabric`.
    lines : PatternLines
        Edges, labels and open seams of a sewing pattern.
    """

    name: str
    positions: Floats
    triangles: Ints
    material_coordinates: Floats
    rest_positions: Floats
    flat: bool
    fabric: Fabric
    velocity: Floats
    groups: Mapping[str, Ints] = field(default_factory=dict)
    texture: Floats = field(default_factory=lambda: np.zeros((0, 3, 2)))
    fabrics: Mapping[str, Fabric] = field(default_factory=dict)
    lines: PatternLines = field(default_factory=PatternLines)

    def per_triangle(self, property_name: str) -> Floats:
        """Return a property of the fabric of each triangle, (m,)."""
        values = np.full(len(self.triangles), getattr(self.fabric, property_name))
        for panel, fabric in self.fabrics.items():
            values[self.groups[panel]] = getattr(fabric, property_name)
        return values


def make_cloth(
    name: str,
    rest_positions: Floats,
    triangles: Ints,
    fabric: Fabric,
    positions: Floats | None = None,
    material_coordinates: Floats | None = None,
    velocity: Floats | tuple[float, float, float] = (0.0, 0.0, 0.0),
    groups: Mapping[str, Ints] | None = None,
    texture: Floats | None = None,
    fabrics: Mapping[str, Fabric] | None = None,
    lines: PatternLines | None = None,
) -> Cloth:
    """Make a cloth from checked arrays.

    Parameters
    ----------
    name, fabric, velocity, groups, texture, fabrics, lines
        See `Cloth`.
    rest_positions : (n, 3) array_like
        Rest shape [m].
    triangles : (m, 3) array_like
        Vertex indices.
    positions : (n, 3) array_like, optional
        Start positions [m]; default: the rest positions.
    material_coordinates : (m, 3, 2) array_like, optional
        Flat rest shape of each triangle [m], in place of that of the rest positions.

    Raises
    ------
    InputError
        Naming the first bad vertex or triangle, also one whose rest shape has no area.
    """
    rest = as_points(f"{name} rest_positions", rest_positions)
    faces = as_triangles(f"{name} triangles", triangles, len(rest))
    start = rest if positions is None else as_points(f"{name} positions", positions)
    if start.shape != rest.shape:
        raise InputError(f"{name}: positions has {len(start)} vertices, rest_positions {len(rest)}.")
    flat = material_coordinates is not None
    material = triangle_planes(rest, faces) if material_coordinates is None else np.asarray(material_coordinates, float)
    if material.shape != (len(faces), 3, 2) or not np.isfinite(material).all():
        raise InputError(f"{name}: material_coordinates must be finite numbers of shape ({len(faces)}, 3, 2).")
    _refuse_no_area(name, material)
    speed, corners = np.asarray(velocity, float), np.zeros((0, 3, 2)) if texture is None else texture
    named = groups or {}, corners, fabrics or {}, lines or PatternLines()
    return Cloth(name, start, faces, material, rest, flat, fabric, speed, *named)


def triangle_planes(rest_positions: Floats, triangles: Ints) -> Floats:
    """Return the corners of triangles in their own frames (m, 3, 2) [m]: t1 = e1/|e1|, n = e1 x e2/|.|, t2 = n x t1."""
    corners = rest_positions[triangles]
    edge1, edge2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    length = np.linalg.norm(edge1, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        t1 = edge1 / length[:, None]
        along = np.einsum("ij,ij->i", edge2, t1)
        height = np.linalg.norm(np.cross(edge1, edge2), axis=1) / length
    planes = np.zeros((len(triangles), 3, 2))
    planes[:, 1, 0] = length
    planes[:, 2, 0] = along
    planes[:, 2, 1] = height
    return planes


def _refuse_no_area(name: str, material: Floats) -> None:
    edge1, edge2 = material[:, 1] - material[:, 0], material[:, 2] - material[:, 0]
    area = 0.5 * (edge1[:, 0] * edge2[:, 1] - edge1[:, 1] * edge2[:, 0])
    longest = np.maximum((edge1**2).sum(1), (edge2**2).sum(1))
    bad = np.flatnonzero(~(np.abs(area) > 1e-14 * longest))
    if bad.size:
        raise InputError(
            f"{name}: triangle {bad[0]} has no area at rest ({bad.size} such triangles).",
            "Remove it or merge its vertices.",
        )
    mirrored = np.flatnonzero(area < 0)
    if mirrored.size and mirrored.size < len(area):
        raise InputError(
            f"{name}: triangle {mirrored[0]} is mirrored in the material plane ({mirrored.size} of {len(area)} are).",
            "Give every triangle of the pattern the same winding.",
        )


@dataclass(frozen=True)
class Hinges:
    """Interior edges with the two triangles beside them.

    Parameters
    ----------
    vertices : (h, 4) int64
        Edge start, edge end, opposite corner in the first and in the second triangle (world numbers).
    corners : (h, 4, 2) float64
        The four at rest in one plane [m], the hinge unfolded: edge along the first axis, the first triangle's corner
        above it, the second's below.
    rest_angles : (h,) float64
        Dihedral angle at rest [rad], 0 where flat.
    stiffness : (h,) float64
        Bending stiffness D [N m], doubled on a clamp line (docs/results/validation.md, A3); where two fabrics meet
        that of both sides in series (see `stiffness_in_series`).
    held : (h,) int64
        Side whose triangle a clamp fixes and which does not bend: 0 the first, 1 the second, -1 neither.
    """

    vertices: Ints
    corners: Floats
    rest_angles: Floats
    stiffness: Floats
    held: Ints

    @property
    def edge_lengths(self) -> Floats:
        """|e| at rest, (h,) [m]."""
        return self.corners[:, 1, 0]

    @property
    def areas(self) -> Floats:
        """A1 + A2, the area of both triangles at rest, (h,) [m2]."""
        return 0.5 * self.edge_lengths * (self.corners[:, 2, 1] - self.corners[:, 3, 1])


NO_HINGES = Hinges(np.zeros((0, 4), np.int64), np.zeros((0, 4, 2)), np.zeros(0), np.zeros(0), np.zeros(0, np.int64))


def cloth_hinges(cloth: Cloth, offset: int = 0) -> Hinges:
    """Return the hinges of one cloth whose first vertex is number `offset` of the world."""
    vertices, pairs = interior_edges(cloth.triangles)
    corners = np.zeros((len(vertices), 4, 2))
    for side, sign in ((0, 1.0), (1, -1.0)):
        shapes = cloth.triangles, cloth.material_coordinates
        length, along, height = corner_over_edge(*shapes, vertices, pairs[:, side], side)
        corners[:, 1, 0] += 0.5 * length
        corners[:, 2 + side, 0] = along
        corners[:, 2 + side, 1] = sign * height
    angles = np.zeros(len(vertices)) if cloth.flat else dihedral_angles(cloth.rest_positions, vertices)
    stiffness = np.full(len(vertices), cloth.fabric.bending_stiffness)
    if cloth.fabrics:
        heights = np.stack([corners[:, 2, 1], -corners[:, 3, 1]], axis=1)
        stiffness = stiffness_in_series(cloth.per_triangle("bending_stiffness")[pairs], heights)
    return Hinges(vertices + offset, corners, angles, stiffness, np.full(len(vertices), -1))


def stiffness_in_series(stiffnesses: Floats, heights: Floats) -> Floats:
    """Return the bending stiffness (h,) [N m] of hinges between two strips.

    Both strips bear the moment M of the hinge and share its angle: h_k M / D_k in strip k, so that
    D = (h_1 + h_2) / (h_1 / D_1 + h_2 / D_2), as a strip of two fabrics does in pure bending. The arithmetic
    mean would be too stiff.

    Parameters
    ----------
    stiffnesses : (h, 2) array
        D of both strips [N m].
    heights : (h, 2) array
        Their widths across the edge [m].
    """
    with np.errstate(divide="ignore"):
        flexibility = (heights / stiffnesses).sum(axis=1)
    alike = stiffnesses[:, 0] == stiffnesses[:, 1]  # to the last bit as within one fabric
    return np.where(alike, stiffnesses[:, 0], heights.sum(axis=1) / flexibility)


def join_hinges(parts: Sequence[Hinges]) -> Hinges:
    """Concatenate hinges."""
    parts = [NO_HINGES, *parts]
    return Hinges(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(Hinges)))


def dihedral_angles(positions: Floats, hinge_vertices: Ints) -> Floats:
    """Return the signed angle between the normals of the two triangles of each hinge, (h,) [rad]; 0 if coplanar.

    Positive where the cloth folds towards its back: the opposite corners move against the normal.
    """
    start, end, first, second = (positions[hinge_vertices[:, k]] for k in range(4))
    edge = end - start
    normal1 = np.cross(edge, first - start)
    normal2 = np.cross(second - start, edge)
    sine = np.einsum("ij,ij->i", np.cross(normal1, normal2), edge) / np.linalg.norm(edge, axis=1)
    return np.arctan2(sine, np.einsum("ij,ij->i", normal1, normal2))


def corner_over_edge(
    triangles: Ints, material_coordinates: Floats, hinges: Ints, triangle: Ints, side: int
) -> tuple[Floats, Floats, Floats]:
    """Return the rest length of the edge, and the opposite corner along it (from the start) and above it [m]."""
    faces = triangles[triangle]
    at = [np.argmax(faces == hinges[:, k : k + 1], axis=1) for k in (0, 1, 2 + side)]
    start, end, corner = (material_coordinates[triangle, k] for k in at)
    edge = end - start
    length = np.linalg.norm(edge, axis=1)
    offset_2d = corner - start
    along = np.einsum("ij,ij->i", offset_2d, edge) / length
    height = np.abs(edge[:, 0] * offset_2d[:, 1] - edge[:, 1] * offset_2d[:, 0]) / length
    return length, along, height
