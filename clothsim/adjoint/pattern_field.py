"""Displacement fields of a flat pattern by the corners of its panels, for `Gradient.rest_along`.

An edge moves as the similarity of the plane that takes its old ends to its new ones, as curves are given relative to
their ends; the inside follows by harmonic extension with cotangent weights (Pinkall & Polthier 1993), which is exact
for affine displacements. The mesh keeps its triangles.
"""

from collections.abc import Mapping

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.linalg import splu

from clothsim.adjoint.gradient import Gradient
from clothsim.arrays import Floats, Ints
from clothsim.errors import InputError
from clothsim.mesh.pattern.pattern import Side
from clothsim.mesh.pattern.pattern_mesh import PatternMesh


def pattern_field(mesh: PatternMesh, displacements: Mapping[str, Floats]) -> Floats:
    """Return the displacements of the corners of all triangles in the material plane, (m, 3, 2) [m].

    Parameters
    ----------
    mesh : PatternMesh
        Mesh of a pattern.
    displacements : mapping of str to (k, 2) arrays
        Displacements of the vertices of panels in their planes [m]; other panels stay.

    Raises
    ------
    InputError
        For a panel that there is not, or an array of another shape.
    """
    field = np.zeros_like(mesh.material_coordinates)
    for name, moves in displacements.items():
        if name not in mesh.pattern.panels:
            raise InputError(f"There is no panel {name!r}.", f"Panels: {', '.join(mesh.pattern.panels)}.")
        wanted = mesh.pattern.panels[name].vertices.shape
        if np.shape(moves) != wanted:
            raise InputError(f"The displacements of panel {name} have the shape {np.shape(moves)}, not {wanted}.")
        moved = _extended(mesh, name, _of_border(mesh, name, np.asarray(moves, np.float64)))
        faces = mesh.faces[name]
        corners = mesh.triangles[faces] - mesh.vertices[name].start
        points = mesh.panel_coordinates[mesh.vertices[name]][corners].reshape(-1, 2)
        material = mesh.material_coordinates[faces].reshape(-1, 2)
        to_material = np.linalg.lstsq(points - points.mean(axis=0), material - material.mean(axis=0), rcond=None)[0]
        field[faces] = moved[corners] @ to_material
    return field


def pattern_gradient(gradient: Gradient, mesh: PatternMesh, panel: str, cloth: str = "") -> Floats:
    """Return the derivative of a loss by the vertices of a panel, (k, 2) [loss / m]; the start is held.

    Parameters
    ----------
    gradient : Gradient
        Of a run whose cloth has the triangles and material coordinates of `mesh`.
    mesh : PatternMesh
        Mesh of its pattern.
    panel : str
        Name of a panel.
    cloth : str
        Name of the cloth; not needed where there is one.
    """
    if panel not in mesh.pattern.panels:
        raise InputError(f"There is no panel {panel!r}.", f"Panels: {', '.join(mesh.pattern.panels)}.")
    out = np.zeros_like(mesh.pattern.panels[panel].vertices)
    for index in np.ndindex(out.shape):
        moves = np.zeros_like(out)
        moves[index] = 1.0
        out[index] = gradient.rest_along(pattern_field(mesh, {panel: moves}), cloth)
    return out


def _of_border(mesh: PatternMesh, name: str, moves: Floats) -> dict[int, Floats]:
    """Displacement (2,) of each vertex of the border, by its row in the mesh."""
    panel, found = mesh.pattern.panels[name], dict[int, Floats]()
    corners, along = panel.vertices @ [1, 1j], moves @ [1, 1j]
    for number, edge in enumerate(panel.edges):
        rows = mesh.edges[Side(name, number)]
        points = mesh.panel_coordinates[rows] @ [1, 1j]
        turn = (along[edge.end] - along[edge.start]) / (corners[edge.end] - corners[edge.start])
        moved = along[edge.start] + turn * (points - corners[edge.start])
        found |= dict(zip(rows.tolist(), np.column_stack([moved.real, moved.imag]), strict=True))
    return found


def _extended(mesh: PatternMesh, name: str, border: Mapping[int, Floats]) -> Floats:
    """Harmonic displacements (k, 2) of all vertices of a panel."""
    rows = mesh.vertices[name]
    n, triangles = rows.stop - rows.start, mesh.triangles[mesh.faces[name]] - rows.start
    out = np.zeros((n, 2))
    held = np.zeros(n, bool)
    for row, moved in border.items():
        out[row - rows.start], held[row - rows.start] = moved, True
    if held.all():
        return out
    matrix = _laplacian(mesh.panel_coordinates[rows], triangles).tocsc()
    free = np.flatnonzero(~held)
    out[free] = splu(matrix[free][:, free].tocsc()).solve(-(matrix[free] @ out))
    return out


def _laplacian(points: Floats, triangles: Ints) -> coo_array:
    """Cotangent Laplacian (n, n) of a plane mesh."""
    entries: list[tuple[Ints, Ints, Floats]] = []
    for k in range(3):
        a, b, c = (triangles[:, (k + j) % 3] for j in range(3))
        u, v = points[b] - points[a], points[c] - points[a]
        weight = 0.5 * (u * v).sum(axis=1) / np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
        entries += [(b, c, -weight), (c, b, -weight), (b, b, weight), (c, c, weight)]
    rows, columns, values = (np.concatenate(part) for part in zip(*entries, strict=True))
    return coo_array((values, (rows, columns)), shape=(len(points), len(points)))
