"""Numbers of a sewing pattern by name: width, height and flare of panels, vertices, and Bezier control points.

The panels named together ("front+back") are scaled alike, about their own centres; `flare` scales each level of a panel
in x, the top (largest y) by 1 and the bottom by the flare. Vertices and control points are set first, in the unscaled
panel. The mesh of the pattern keeps its triangles.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.gradients.pattern_field import bezier_edge, follow, pattern_field
from clothsim.patterns.curves import Bezier
from clothsim.patterns.pattern import Side
from clothsim.patterns.pattern_mesh import PatternMesh

SECTION = "pattern."
EXTENTS = ("width", "height", "flare")
_PATH = re.compile(
    rf"pattern\.(?P<panels>.+?)\.(?:(?P<extent>{'|'.join(EXTENTS)})"
    r"|(?:vertex\[(?P<vertex>\d+)\]|edge\[(?P<edge>\d+)\]\.control\[(?P<control>\d+)\])\.(?P<axis>[xy]))"
)
STEP = 1e-4
"""Change of a number that differences of the material coordinates take, of itself or of the panel's extent."""


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
        """Return what a path such as "pattern.front.width" names. InputError where it names nothing."""
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
        """Return the number in the pattern: a length or coordinate [m], of a flare 1."""
        number = self.number(path)
        if number.extent == "flare":
            return 1.0
        if number.extent:
            return float(self.extent(number.panels[0])[1][EXTENTS.index(number.extent)])
        return float(self.point(number)[number.axis])

    def size(self, path: str) -> float:
        """Return the length [m] that changes of a number are measured by; 1 for a flare."""
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
        """Return the corners of the triangles at rest, (m, 3, 2) [m], with other numbers."""
        return self.mesh.material_coordinates + pattern_field(self.mesh, *self._moves(values))

    def field(self, values: Mapping[str, float], path: str) -> Floats:
        """Return the derivative of the material coordinates by one of the numbers, (m, 3, 2)."""
        step = STEP * self.size(path)
        sides = [self.material_coordinates({**values, path: values[path] + sign * step}) for sign in (1, -1)]
        return (sides[0] - sides[1]) / (2 * step)

    def extent(self, panel: str) -> tuple[Floats, Floats]:
        """Return the least corner of the box about a panel, (2,), and its sides, (2,) [m]."""
        points = self.mesh.panel_coordinates[self.mesh.vertices[panel]]
        return points.min(axis=0), np.ptp(points, axis=0)

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
            factors = np.array([self._factor(own, values, extent) for extent in EXTENTS])
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

    def _factor(self, own: Mapping[str, PatternNumber], values: Mapping[str, float], extent: str) -> float:
        return float(np.prod([values[path] / self.value(path) for path, each in own.items() if each.extent == extent]))

    def _scaled(self, panel: str, points: Floats, factors: Floats) -> Floats:
        """Points of a panel by the factors of its width, height and flare."""
        low, sides = self.extent(panel)
        down = (low[1] + sides[1] - points[:, 1]) / sides[1]
        across = factors[0] * (1 + (factors[2] - 1) * down)
        centre = low + sides / 2
        return centre + (points - centre) * np.column_stack([across, np.full(len(points), factors[1])])
