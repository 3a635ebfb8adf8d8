"""Surface appearance without lighting: corner normals, and colours of both sides."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.sparse import csr_array

from clothsim.base.arrays import Floats, Ints
from clothsim.render.colormap import log_stretch, per_vertex
from clothsim.render.colour_scale import Scale
from clothsim.render.strokes import INK, ribbons

BODY_GREY = np.array([0.70, 0.70, 0.71])
FABRICS = np.array([[0.46, 0.60, 0.72], [0.80, 0.63, 0.45], [0.56, 0.68, 0.55], [0.72, 0.55, 0.62]])
_BACK = np.array([0.84, 0.84, 0.87])
_COS_CREASE = np.cos(np.radians(50.0))


@dataclass(frozen=True)
class Surface:
    """One cloth or body at one time.

    positions: (n, 3) [m]; triangles: (m, 3); role: "cloth" or "body"; principal_stretches: (m, 2), or empty (0, 2)
    where they are not known, which draws the cloth in its plain colour; values: (n,) that colour the cloth instead, or
    empty; strokes: (k, 2, 2, 3) ends of crosses drawn on it [m], `spacing` [m] apart; fabrics: (m,) number of the
    fabric of each triangle, which has a plain colour of its own, or empty; material: (n, 3) positions of the
    undeformed cloth that a weave is fixed to [m], or empty.
    """

    name: str
    positions: Floats
    triangles: Ints
    role: str
    principal_stretches: Floats
    values: Floats = field(default_factory=lambda: np.zeros(0))
    strokes: Floats = field(default_factory=lambda: np.zeros((0, 2, 2, 3)))
    spacing: float = 0.0
    fabrics: Ints = field(default_factory=lambda: np.zeros(0, np.int64))
    material: Floats = field(default_factory=lambda: np.zeros((0, 3)))


@dataclass(frozen=True)
class Look:
    """Triangles with corners of their own: positions [m], unit normals, sRGB of front and back, each (m, 3, 3)."""

    corners: Floats
    normals: Floats
    front: Floats
    back: Floats


def looks(surfaces: Sequence[Surface], scale: Scale | None) -> list[Look]:
    """The look of each surface and of the strokes on it; cloth by its values or else its log l, plain without scale."""
    made, n_cloths = [], 0
    for surface in surfaces:
        corners = surface.positions[surface.triangles]
        if surface.role == "body":
            paint = np.broadcast_to(BODY_GREY, corners.shape)
            made.append(Look(corners, creased_normals(surface.positions, surface.triangles), paint, paint))
            continue
        values = vertex_values(surface)
        if scale is not None and len(values):
            front = scale.colours(values)[surface.triangles]
        else:
            numbers = surface.fabrics if len(surface.fabrics) else np.zeros(len(corners), np.int64)
            front = np.broadcast_to(FABRICS[(n_cloths + numbers) % len(FABRICS), None], corners.shape)
        n_cloths += 1
        normals = vertex_normals(surface.positions, surface.triangles)[surface.triangles]
        made.append(Look(corners, normals, front, front * _BACK))
        if len(surface.strokes):
            corners, normals = ribbons(surface.strokes, surface.spacing)
            paint = np.broadcast_to(INK, corners.shape)
            made.append(Look(corners, normals, paint, paint))
    return made


def vertex_values(surface: Surface) -> Floats:
    """The numbers at the vertices (n,) that colour a cloth; none where they are not known."""
    if len(surface.values) or not len(surface.principal_stretches):
        return surface.values
    return per_vertex(log_stretch(surface.principal_stretches), surface.positions, surface.triangles)


def vertex_normals(positions: Floats, triangles: Ints) -> Floats:
    """Unit normals at the vertices, (n, 3): the triangles' weighted by area; z where there is none."""
    doubled = _area_normals(positions, triangles)
    corners = triangles.ravel()
    summed = [np.bincount(corners, np.repeat(doubled[:, k], 3), minlength=len(positions)) for k in range(3)]
    return _unit(np.column_stack(summed))


def creased_normals(positions: Floats, triangles: Ints) -> Floats:
    """Unit normals at the corners, (m, 3, 3): the mean over the triangles at the vertex within 50 degrees of its own.

    So a box keeps its edges and a body is smooth.
    """
    doubled = _area_normals(positions, triangles)
    unit = _unit(doubled)
    n_corners = triangles.size
    rows = np.arange(n_corners)
    at_vertex = csr_array((np.ones(n_corners), (triangles.ravel(), rows // 3)), shape=(len(positions), len(triangles)))
    pairs = at_vertex[triangles.ravel()].tocoo()
    alike = np.einsum("ij,ij->i", unit[pairs.row // 3], unit[pairs.col]) > _COS_CREASE
    row, col = pairs.row[alike], pairs.col[alike]
    summed = [np.bincount(row, doubled[col, k], minlength=n_corners) for k in range(3)]
    return _unit(np.column_stack(summed)).reshape(-1, 3, 3)


def _area_normals(positions: Floats, triangles: Ints) -> Floats:
    a, b, c = (positions[triangles[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


def _unit(vectors: np.ndarray) -> Floats:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.where(length > 0, vectors / np.where(length > 0, length, 1.0), [0.0, 0.0, 1.0])
