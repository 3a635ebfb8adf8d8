"""Cloth: start positions, and the rest shape of its material."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from clothsim.base.arrays import Floats, Ints, as_points, as_triangles
from clothsim.base.errors import InputError
from clothsim.keys.fabric import Fabric
from clothsim.mesh.pattern_lines import PatternLines


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
