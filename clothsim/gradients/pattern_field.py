"""Displacement fields of a flat pattern by the corners and Bezier control points of its panels.

An edge moves as the similarity of the plane that takes its old ends to its new ones, as curves are given relative to
their ends; where the control points of a Bezier edge move otherwise, its samples follow by Bernstein's weights, their
parameters held. The inside follows by harmonic extension with cotangent weights (Pinkall & Polthier 1993), which is
exact for affine displacements. The mesh keeps its triangles. `Gradient.rest_along` takes such a field.
"""

from collections.abc import Mapping

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.linalg import splu

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.gradients.gradient import Gradient
from clothsim.patterns.curves import Bezier
from clothsim.patterns.pattern import Panel, PatternEdge, Side
from clothsim.patterns.pattern_mesh import PatternMesh


def pattern_field(
    mesh: PatternMesh, displacements: Mapping[str, Floats], controls: Mapping[Side, Floats] | None = None
) -> Floats:
    """Return the displacements of the corners of all triangles in the material plane, (m, 3, 2) [m].

    Parameters
    ----------
    mesh : PatternMesh
        Mesh of a pattern.
    displacements : mapping of str to (k, 2) arrays
        Displacements of the vertices of panels in their planes [m]; other panels stay.
    controls : mapping of Side to (1 or 2, 2) arrays
        Displacements of the control points of Bezier edges in the plane of the panel [m]; those of other edges follow
        the ends of the edge.

    Raises
    ------
    InputError
        For a panel that there is not, an edge that is no Bezier curve, or an array of another shape.
    """
    field, given = np.zeros_like(mesh.material_coordinates), dict(controls or {})
    for side, moves in given.items():
        bezier_edge(mesh, side, np.shape(moves))
    for name in dict.fromkeys([*displacements, *(side.panel for side in given)]):
        panel = _panel(mesh, name)
        corner_moves = np.asarray(displacements.get(name, np.zeros_like(panel.vertices)), np.float64)
        if corner_moves.shape != panel.vertices.shape:
            raise InputError(
                f"The displacements of panel {name} have the shape {corner_moves.shape}, not {panel.vertices.shape}."
            )
        moved = _extended(mesh, name, _of_border(mesh, name, corner_moves, given))
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
    out = np.zeros_like(_panel(mesh, panel).vertices)
    for index in np.ndindex(out.shape):
        moves = np.zeros_like(out)
        moves[index] = 1.0
        out[index] = gradient.rest_along(pattern_field(mesh, {panel: moves}), cloth)
    return out


def control_gradient(gradient: Gradient, mesh: PatternMesh, panel: str, edge: int, cloth: str = "") -> Floats:
    """Return the derivative of a loss by the control points of a Bezier edge, (1 or 2, 2) [loss / m].

    Parameters
    ----------
    gradient, mesh, panel, cloth
        As of `pattern_gradient`.
    edge : int
        Number of an edge of the panel in `mesh.pattern`.

    Raises
    ------
    InputError
        For an edge that is no Bezier curve.
    """
    side = Side(panel, edge)
    out = np.zeros((len(bezier_edge(mesh, side).controls), 2))
    for index in np.ndindex(out.shape):
        moves = np.zeros_like(out)
        moves[index] = 1.0
        out[index] = gradient.rest_along(pattern_field(mesh, {}, {side: moves}), cloth)
    return out


def bezier_edge(mesh: PatternMesh, side: Side, shape: tuple[int, ...] | None = None) -> Bezier:
    """Return the curve of an edge. InputError for one that is no Bezier curve, or has no `shape` of control points."""
    edges = _panel(mesh, side.panel).edges
    curve = edges[side.edge].curve if 0 <= side.edge < len(edges) else None
    if not isinstance(curve, Bezier):
        known = [str(k) for k, edge in enumerate(edges) if isinstance(edge.curve, Bezier)]
        raise InputError(
            f"The {side} is no Bezier curve, and has no control points.",
            f"Bezier edges of {side.panel}: {', '.join(known) or 'none'}.",
        )
    if shape is not None and shape != (len(curve.controls), 2):
        raise InputError(f"The displacements of the {side} have the shape {shape}, not {(len(curve.controls), 2)}.")
    return curve


def follow(panel: Panel, edge: PatternEdge, moves: Floats, points: Floats) -> Floats:
    """Return the displacements (k, 2) of points (k, 2) of an edge by those of the panel's vertices: a similarity."""
    corners, along, at = panel.vertices @ [1, 1j], moves @ [1, 1j], points @ [1, 1j]
    turn = (along[edge.end] - along[edge.start]) / (corners[edge.end] - corners[edge.start])
    moved = along[edge.start] + turn * (at - corners[edge.start])
    return np.column_stack([moved.real, moved.imag])


def _panel(mesh: PatternMesh, name: str) -> Panel:
    if name not in mesh.pattern.panels:
        raise InputError(f"There is no panel {name!r}.", f"Panels: {', '.join(mesh.pattern.panels)}.")
    return mesh.pattern.panels[name]


def _of_border(mesh: PatternMesh, name: str, moves: Floats, controls: Mapping[Side, Floats]) -> dict[int, Floats]:
    """Displacement (2,) of each vertex of the border, by its row in the mesh."""
    panel, found = mesh.pattern.panels[name], dict[int, Floats]()
    for number, edge in enumerate(panel.edges):
        side = Side(name, number)
        rows = mesh.edges[side]
        if side in controls:
            curve, ends = bezier_edge(mesh, side), [panel.vertices[k] for k in (edge.start, edge.end)]
            t = curve.parameters(ends[0], ends[1], mesh.fractions[side])
            moved = curve.weights(t) @ np.concatenate([moves[[edge.start]], controls[side], moves[[edge.end]]])
        else:
            moved = follow(panel, edge, moves, mesh.panel_coordinates[rows])
        found |= dict(zip(rows.tolist(), moved, strict=True))
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
