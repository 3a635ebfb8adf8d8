"""DXF drawings of sewing patterns, written with ezdxf, and their sewing files."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from clothsim.files.patterns.dxf.outline import Part, polygon
from clothsim.patterns.curves import Arc, Bezier
from clothsim.patterns.pattern import Panel, Pattern

MILLIMETRES = 4
"""$INSUNITS."""


def write_drawing(path: Path, pattern: Pattern, layer: str = "14") -> dict[str, np.ndarray]:
    """Write a block for each panel, with a notch at each corner; the middle of each panel (2,) [m].

    A panel whose loop runs clockwise is written mirrored, as its piece would be cut: counter-clockwise.
    """
    import ezdxf

    document = ezdxf.new("R2010")
    document.header["$INSUNITS"] = MILLIMETRES
    middles = {}
    for number, (name, panel) in enumerate(pattern.panels.items()):
        block = document.blocks.new(f"B{number}")
        block.add_text(f"Piece Name: {name}", dxfattribs={"layer": "15"})
        sign = np.array([-1.0 if clockwise(panel) else 1.0, 1.0])
        for edge in range(len(panel.edges)):
            draw_edge(block, panel, edge, sign, layer)
        for corner in 1e3 * sign * panel.vertices:
            block.add_point(tuple(corner), dxfattribs={"layer": "4"})
        document.modelspace().add_blockref(block.name, (0, 0))
        points = border(panel)
        middles[name] = (points.min(axis=0) + points.max(axis=0)) / 2
    document.saveas(path)
    return middles


def draw_edge(block: Any, panel: Panel, number: int, sign: np.ndarray, layer: str) -> None:
    """A LINE, an ARC or a SPLINE."""
    edge, keys = panel.edges[number], {"layer": layer}
    start, end = panel.vertices[edge.start], panel.vertices[edge.end]
    if isinstance(edge.curve, Bezier):
        points = 1e3 * sign * edge.curve.points(start, end)
        spline = block.add_spline(degree=len(points) - 1, dxfattribs=keys)
        spline.control_points = [(x, y, 0) for x, y in points]
        spline.knots = [0.0] * len(points) + [1.0] * len(points)
    elif isinstance(edge.curve, Arc):
        centre, radius, sweep = edge.curve.circle(start, end)
        angles = [np.degrees(np.arctan2(*((p - centre) * sign)[::-1])) for p in (start, end)]
        first, last = angles if sweep * sign[0] > 0 else angles[::-1]
        block.add_arc(tuple(1e3 * sign * centre), 1e3 * radius, first, last, dxfattribs=keys)
    else:
        block.add_line(tuple(1e3 * sign * start), tuple(1e3 * sign * end), dxfattribs=keys)


def clockwise(panel: Panel) -> bool:
    """True where the loop of a panel encloses a negative area."""
    x, y = border(panel).T
    return float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum()) < 0


def border(panel: Panel) -> np.ndarray:
    """Border of a panel, sampled as in the reader, (k, 2) [m]."""
    return polygon([Part(panel.vertices[edge.start], panel.vertices[edge.end], edge.curve) for edge in panel.edges])


def sewing_text(pattern: Pattern, middles: Mapping[str, np.ndarray]) -> str:
    """TOML with the placement of the panels and the seams of a pattern."""
    lines = []
    for name, panel in pattern.panels.items():
        place = panel.placed(middles[name][None])[0]
        lines += [
            f"[panels.{name}]",
            f"position = {place.tolist()}",
            f"rotation_degrees = {np.degrees(panel.rotation).tolist()}",
            *(["mirrored = true"] if clockwise(panel) else []),
        ]
    for stitch in pattern.stitches:
        first, second = ({"panel": side.panel, "edge": side.edge} for side in stitch.sides)
        lines += ["[[seam]]", f"from = {inline(first)}", f"to = {inline(second)}"]
        lines += ["right_wrong = true"] if stitch.right_wrong else []
    return "\n".join(lines) + "\n"


def inline(side: Mapping[str, Any]) -> str:
    """An inline table of TOML."""
    return f'{{ panel = "{side["panel"]}", edge = {side["edge"]} }}'
