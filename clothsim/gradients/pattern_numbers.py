"""Numbers of a sewing pattern by name, and the displacement fields of its mesh that they cause.

Numbers are width, height and flare of panels, vertices, and Bezier control points. Panels named together ("front+back")
are scaled by the same factor, each about its own centre. `flare` scales each level of a panel in x, from 1 at the top
(largest y) to the flare at the bottom. Vertices and control points are set first, in the unscaled panel. The triangles
of the mesh stay the same.

In a displacement field, an edge moves by the similarity of the plane that maps its old ends to its new ones, because
curves are given relative to their ends. If the control points of a Bezier edge move differently, its samples follow by
Bernstein's weights at fixed parameters. The inside follows by harmonic extension with cotangent weights (Pinkall &
Polthier 1993), which is exact for affine displacements. `Gradient.rest_along` takes such a field.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse.linalg import splu

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.base.triangles import cotangent_laplacian
from clothsim.gradients.gradient import Gradient
from clothsim.patterns.curves import Bezier
from clothsim.patterns.pattern import Panel, Pattern, PatternEdge, Side
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
        For a missing panel, an edge that is not a Bezier curve, or an array of a wrong shape.
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
        # harmonic displacements (k, 2) of all vertices of the panel
        rows = mesh.vertices[name]
        n, triangles = rows.stop - rows.start, mesh.triangles[mesh.faces[name]] - rows.start
        moved, held = np.zeros((n, 2)), np.zeros(n, bool)
        for row, at_border in _displace_border(mesh, name, corner_moves, given).items():
            moved[row - rows.start], held[row - rows.start] = at_border, True
        if not held.all():
            matrix = cotangent_laplacian(np.pad(mesh.panel_coordinates[rows], ((0, 0), (0, 1))), triangles)
            free = np.flatnonzero(~held)
            moved[free] = splu(matrix[free][:, free].tocsc()).solve(-(matrix[free] @ moved))
        faces = mesh.faces[name]
        corners = mesh.triangles[faces] - mesh.vertices[name].start
        points = mesh.panel_coordinates[mesh.vertices[name]][corners].reshape(-1, 2)
        material = mesh.material_coordinates[faces].reshape(-1, 2)
        to_material = np.linalg.lstsq(points - points.mean(axis=0), material - material.mean(axis=0), rcond=None)[0]
        field[faces] = moved[corners] @ to_material
    return field


def pattern_gradient(gradient: Gradient, mesh: PatternMesh, panel: str, cloth: str = "") -> Floats:
    """Return the derivative of a loss with respect to the vertices of a panel, (k, 2) [loss / m], with a fixed start.

    Parameters
    ----------
    gradient : Gradient
        Gradient of a run whose cloth has the triangles and material coordinates of `mesh`.
    mesh : PatternMesh
        Mesh of its pattern.
    panel : str
        Name of a panel.
    cloth : str
        Name of the cloth; not needed if there is only one.
    """
    out = np.zeros_like(_panel(mesh, panel).vertices)
    for index in np.ndindex(out.shape):
        moves = np.zeros_like(out)
        moves[index] = 1.0
        out[index] = gradient.rest_along(pattern_field(mesh, {panel: moves}), cloth)
    return out


def control_gradient(gradient: Gradient, mesh: PatternMesh, panel: str, edge: int, cloth: str = "") -> Floats:
    """Return the derivative of a loss with respect to the control points of a Bezier edge, (1 or 2, 2) [loss / m].

    Parameters
    ----------
    gradient, mesh, panel, cloth
        As in `pattern_gradient`.
    edge : int
        Number of an edge of the panel in `mesh.pattern`.

    Raises
    ------
    InputError
        For an edge that is not a Bezier curve.
    """
    side = Side(panel, edge)
    out = np.zeros((len(bezier_edge(mesh, side).controls), 2))
    for index in np.ndindex(out.shape):
        moves = np.zeros_like(out)
        moves[index] = 1.0
        out[index] = gradient.rest_along(pattern_field(mesh, {}, {side: moves}), cloth)
    return out


def bezier_edge(mesh: PatternMesh, side: Side, shape: tuple[int, ...] | None = None) -> Bezier:
    """Return the curve of an edge. InputError if it is not a Bezier curve, or has no `shape` of control points."""
    edges = _panel(mesh, side.panel).edges
    curve = edges[side.edge].curve if 0 <= side.edge < len(edges) else None
    if not isinstance(curve, Bezier):
        known = [str(k) for k, edge in enumerate(edges) if isinstance(edge.curve, Bezier)]
        raise InputError(
            f"The {side} is not a Bezier curve, and has no control points.",
            f"Bezier edges of {side.panel}: {', '.join(known) or 'none'}.",
        )
    if shape is not None and shape != (len(curve.controls), 2):
        raise InputError(f"The displacements of the {side} have the shape {shape}, not {(len(curve.controls), 2)}.")
    return curve


def follow(panel: Panel, edge: PatternEdge, moves: Floats, points: Floats) -> Floats:
    """Return the displacements (k, 2) of points (k, 2) of an edge that moves by a similarity with its vertices."""
    corners, along, at = panel.vertices @ [1, 1j], moves @ [1, 1j], points @ [1, 1j]
    turn = (along[edge.end] - along[edge.start]) / (corners[edge.end] - corners[edge.start])
    moved = along[edge.start] + turn * (at - corners[edge.start])
    return np.column_stack([moved.real, moved.imag])


def _panel(mesh: PatternMesh, name: str) -> Panel:
    if name not in mesh.pattern.panels:
        raise InputError(f"There is no panel {name!r}.", f"Panels: {', '.join(mesh.pattern.panels)}.")
    return mesh.pattern.panels[name]


def _displace_border(mesh: PatternMesh, name: str, moves: Floats, controls: Mapping[Side, Floats]) -> dict[int, Floats]:
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


SECTION = "pattern."
EXTENTS = ("width", "height", "flare")
_PATH = re.compile(
    rf"pattern\.(?P<panels>.+?)\.(?:(?P<extent>{'|'.join(EXTENTS)})"
    r"|(?:vertex\[(?P<vertex>\d+)\]|edge\[(?P<edge>\d+)\]\.control\[(?P<control>\d+)\])\.(?P<axis>[xy]))"
)
STEP = 1e-4
"""Change of a number in differences of the material coordinates, relative to the number or to the panel's extent."""


@dataclass(frozen=True)
class PatternNumber:
    """A number of a pattern.

    Parameters
    ----------
    panels : tuple of str
        The panels.
    extent : str
        "width", "height" or "flare"; empty for a coordinate.
    vertex, edge, control : int
        The vertex, or the edge and its control point; -1 for none.
    axis : int
        0 for x, 1 for y.
    """

    panels: tuple[str, ...]
    extent: str = ""
    vertex: int = -1
    edge: int = -1
    control: int = -1
    axis: int = 0


@dataclass(frozen=True)
class PatternNumbers:
    """Material coordinates of a meshed pattern as a function of named numbers."""

    mesh: PatternMesh

    def number(self, path: str) -> PatternNumber:
        """Return what a path such as "pattern.front.width" names. InputError if it names nothing."""
        found = _PATH.fullmatch(path)
        if found is None:
            raise InputError(
                f"{path!r} names no number of a pattern.",
                "Write pattern.PANEL.width, .height, .flare, .vertex[0].x or .edge[0].control[0].y.",
            )
        number, panels = found.groupdict(), tuple(found["panels"].split("+"))
        for name in panels:
            if name not in self.mesh.pattern.panels:
                raise InputError(f"There is no panel {name!r}.", f"Panels: {', '.join(self.mesh.pattern.panels)}.")
        if number["extent"]:
            return PatternNumber(panels, number["extent"])
        if len(panels) > 1:
            raise InputError(f"{path!r} is a coordinate of several panels.", "Name one panel.")
        vertex, edge, control = (
            -1 if number[key] is None else int(number[key]) for key in ("vertex", "edge", "control")
        )
        count = len(self.mesh.pattern.panels[panels[0]].vertices)
        if vertex >= count:
            raise InputError(f"Panel {panels[0]} has no vertex {vertex}.", f"It has {count}, counted from 0.")
        if edge >= 0:
            controls = len(bezier_edge(self.mesh, Side(panels[0], edge)).controls)
            if control >= controls:
                raise InputError(f"Edge {edge} of {panels[0]} has no control point {control}.", f"It has {controls}.")
        return PatternNumber(panels, "", vertex, edge, control, "xy".index(number["axis"]))

    def value(self, path: str) -> float:
        """Return the number in the pattern: a length or coordinate [m], or 1 for a flare."""
        number = self.number(path)
        if number.extent == "flare":
            return 1.0
        if number.extent:
            return float(self.extent(number.panels[0])[1][EXTENTS.index(number.extent)])
        return float(self.point(number)[number.axis])

    def size(self, path: str) -> float:
        """Return the length [m] relative to which changes of a number are measured; 1 for a flare."""
        number = self.number(path)
        if number.extent:
            return self.value(path)
        return float(self.extent(number.panels[0])[1].max())

    def point(self, number: PatternNumber) -> Floats:
        """Return the vertex or control point of a number in the plane of its panel, (2,) [m]."""
        panel = self.mesh.pattern.panels[number.panels[0]]
        if number.vertex >= 0:
            return panel.vertices[number.vertex].copy()
        edge, curve = panel.edges[number.edge], bezier_edge(self.mesh, Side(panel.name, number.edge))
        return curve.points(panel.vertices[edge.start], panel.vertices[edge.end])[1 + number.control]

    def material_coordinates(self, values: Mapping[str, float]) -> Floats:
        """Return the corners of the triangles at rest, (m, 3, 2) [m], for other numbers."""
        return self.mesh.material_coordinates + pattern_field(self.mesh, *self._moves(values))

    def field(self, values: Mapping[str, float], path: str) -> Floats:
        """Return the derivative of the material coordinates with respect to one of the numbers, (m, 3, 2)."""
        step = STEP * self.size(path)
        sides = [self.material_coordinates({**values, path: values[path] + sign * step}) for sign in (1, -1)]
        return (sides[0] - sides[1]) / (2 * step)

    def extent(self, panel: str) -> tuple[Floats, Floats]:
        """Return the least corner of the box about a panel, (2,), and its sides, (2,) [m]."""
        points = self.mesh.panel_coordinates[self.mesh.vertices[panel]]
        return points.min(axis=0), np.ptp(points, axis=0)

    def pattern(self, values: Mapping[str, float]) -> Pattern:
        """Return the pattern cut to other numbers, for a file."""
        pattern, (moves, controls) = self.mesh.pattern, self._moves(values)
        panels = dict(pattern.panels)
        for name, moved in moves.items():
            panel = panels[name]
            vertices, edges = panel.vertices + moved, list(panel.edges)
            for side in (each for each in controls if each.panel == name):
                edge = edges[side.edge]
                before = bezier_edge(self.mesh, side).points(panel.vertices[edge.start], panel.vertices[edge.end])
                start, end = vertices[edge.start], vertices[edge.end]
                chord = end - start
                axes = np.column_stack([chord, [-chord[1], chord[0]]])
                relative = np.linalg.solve(axes, (before[1:-1] + controls[side] - start).T).T
                edges[side.edge] = replace(edge, curve=Bezier(tuple((float(x), float(y)) for x, y in relative)))
            panels[name] = replace(panel, vertices=vertices, edges=tuple(edges))
        return replace(pattern, panels=panels)

    def _moves(self, values: Mapping[str, float]) -> tuple[dict[str, Floats], dict[Side, Floats]]:
        """Displacements of the vertices of panels and of the control points of their Bezier edges."""
        numbers = {path: self.number(path) for path in values}
        names = dict.fromkeys(name for number in numbers.values() for name in number.panels)
        moves, controls = dict[str, Floats](), dict[Side, Floats]()
        for name in names:
            panel = self.mesh.pattern.panels[name]
            own = {path: number for path, number in numbers.items() if name in number.panels}
            moved = panel.vertices.copy()
            for path, number in own.items():
                if number.vertex >= 0:
                    moved[number.vertex, number.axis] = values[path]
            of_extents = {path: values[path] / self.value(path) for path, each in own.items() if each.extent}
            factors = np.array(
                [np.prod([by for path, by in of_extents.items() if own[path].extent == extent]) for extent in EXTENTS]
            )
            for k, edge in enumerate(panel.edges):
                if not isinstance(edge.curve, Bezier):
                    continue
                before = edge.curve.points(panel.vertices[edge.start], panel.vertices[edge.end])[1:-1]
                after = before + follow(panel, edge, moved - panel.vertices, before)
                for path, number in own.items():
                    if number.edge == k:
                        after[number.control, number.axis] = values[path]
                controls[Side(name, k)] = self._scaled(name, after, factors) - before
            moves[name] = self._scaled(name, moved, factors) - panel.vertices
        return moves, controls

    def _scaled(self, panel: str, points: Floats, factors: Floats) -> Floats:
        """Points of a panel by the factors of its width, height and flare."""
        low, sides = self.extent(panel)
        down = (low[1] + sides[1] - points[:, 1]) / sides[1]
        across = factors[0] * (1 + (factors[2] - 1) * down)
        centre = low + sides / 2
        return centre + (points - centre) * np.column_stack([across, np.full(len(points), factors[1])])
