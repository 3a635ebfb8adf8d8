"""Hinges: interior edges about which a cloth bends, with their rest shape."""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.mesh.cloth import Cloth
from clothsim.mesh.topology import interior_edges


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


def cloth_hinges(cloth: Cloth, offset: int = 0) -> Hinges:
    """Return the hinges of one cloth whose first vertex is number `offset` of the world."""
    vertices, pairs = interior_edges(cloth.triangles)
    corners = np.zeros((len(vertices), 4, 2))
    for side, sign in ((0, 1.0), (1, -1.0)):
        length, along, height = corner_over_edge(cloth, vertices, pairs[:, side], side)
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


def corner_over_edge(cloth: Cloth, hinges: Ints, triangle: Ints, side: int) -> tuple[Floats, Floats, Floats]:
    """Return the rest length of the edge, and the opposite corner along it (from the start) and above it [m]."""
    faces = cloth.triangles[triangle]
    at = [np.argmax(faces == hinges[:, k : k + 1], axis=1) for k in (0, 1, 2 + side)]
    start, end, corner = (cloth.material_coordinates[triangle, k] for k in at)
    edge = end - start
    length = np.linalg.norm(edge, axis=1)
    offset_2d = corner - start
    along = np.einsum("ij,ij->i", offset_2d, edge) / length
    height = np.abs(edge[:, 0] * offset_2d[:, 1] - edge[:, 1] * offset_2d[:, 0]) / length
    return length, along, height
