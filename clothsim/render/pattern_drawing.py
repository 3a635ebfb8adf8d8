"""Drawing of a sewing pattern: panels laid out flat, each seam in one colour and with one number on both sides."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps, rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.patterns.borders import enclosed_area
from clothsim.patterns.pattern import SAMPLES, Panel, Pattern, Side

FORMATS = (".svg", ".png", ".pdf")
GAP = 0.06
"""Distance between panels [m]."""
FABRIC, OUTLINE, TEXT = "#f3efe8", "#55524c", "#1d1d1b"
TALL, LETTER = 0.12, 0.012
"""Height of a panel [m] and width of each letter [m] below which its name stands under it."""
NUMBER = 0.012
"""Distance of the number of an edge from it [m]."""
WIDTH = 11.0
"""Width of the drawing [inch]."""


def draw_pattern(file: str | Path, pattern: Pattern, title: str = "", edge_numbers: bool = False) -> Path:
    """Draw the panels of a pattern with the numbers of their seams and the thread line.

    Parameters
    ----------
    file : str or Path
        An .svg, .png or .pdf file.
    pattern : Pattern
        Panels and stitches.
    title : str
        Headline.
    edge_numbers : bool
        True: the number of each edge beside its middle, in place of those of seams.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    InputError
        Another ending of the name.
    """
    path = Path(file)
    if path.suffix.lower() not in FORMATS:
        raise InputError(f"{path} ends with {path.suffix!r}.", f"Known: {', '.join(FORMATS)}.")
    outlines = {name: panel.outline for name, panel in pattern.panels.items()}
    shifts, size = laid_out(outlines)
    figure = Figure(figsize=(WIDTH, max(2.5, WIDTH * size[1] / size[0])), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    axes.set_aspect("equal")
    axes.axis("off")
    axes.set_xlim(-GAP / 2, size[0] + GAP / 2)
    axes.set_ylim(-GAP / 2, size[1] + GAP / 2)
    if title:
        axes.set_title(title, color=TEXT, fontsize=11)
    colours = seam_colours(pattern)
    for name, panel in pattern.panels.items():
        _draw_panel(axes, panel, outlines[name], shifts[name], colours, edge_numbers)
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": "pattern"}):
        figure.savefig(path, dpi=120, metadata={"Date": None} if path.suffix.lower() == ".svg" else None)
    return path


def laid_out(outlines: Mapping[str, Floats]) -> tuple[dict[str, Floats], Floats]:
    """Shift (2,) [m] of each panel, in rows, and the size (2,) of the sheet that they fill [m]."""
    sizes = {name: np.ptp(points, axis=0) + GAP for name, points in outlines.items()}
    widest = max(np.sqrt(1.7 * sum(size.prod() for size in sizes.values())), *(size[0] for size in sizes.values()))
    rows: list[list[str]] = [[]]
    for name in sizes:
        if rows[-1] and sum(sizes[each][0] for each in rows[-1]) + sizes[name][0] > widest:
            rows.append([])
        rows[-1].append(name)
    shifts, top = {}, sum(max(sizes[name][1] for name in row) for row in rows)
    sheet = np.array([max(sum(sizes[name][0] for name in row) for row in rows), top])
    for row in rows:
        left, height = 0.0, max(sizes[name][1] for name in row)
        for name in row:
            corner = np.array([left + GAP / 2, top - (height + sizes[name][1]) / 2 + GAP / 2])
            shifts[name] = corner - outlines[name].min(axis=0)
            left += sizes[name][0]
        top -= height
    return shifts, sheet


def seam_colours(pattern: Pattern) -> dict[Side, tuple[int, Any]]:
    """Number of the seam and its colour, for each edge that is sewn."""
    table = colormaps["tab20"]
    order = [*range(0, 20, 2), *range(1, 20, 2)]  # strong colours first
    return {
        side: (number, table(order[number % 20])) for number, each in enumerate(pattern.stitches) for side in each.sides
    }


def _draw_panel(
    axes: Axes, panel: Panel, points: Floats, shift: Floats, colours: Mapping[Side, Any], edge_numbers: bool
) -> None:
    moved = points + shift
    axes.fill(*moved.T, facecolor=FABRIC, edgecolor="none", zorder=1)
    along_edge = np.linspace(0, 1, SAMPLES)
    for number in range(len(panel.edges)):
        line = panel.edge_points(number, along_edge) + shift
        sewn = colours.get(Side(panel.name, number))
        axes.plot(*line.T, color=OUTLINE if sewn is None else sewn[1], linewidth=1.0 if sewn is None else 2.6, zorder=2)
        if edge_numbers:
            # the number inside the panel beside the middle of the edge, and a dot at its start
            middle, along = line[SAMPLES // 2], line[SAMPLES // 2 + 1] - line[SAMPLES // 2 - 1]
            left = np.array([-along[1], along[0]]) / np.linalg.norm(along)
            inward = left if enclosed_area(moved) > 0 else -left
            x, y = middle + NUMBER * inward
            axes.text(x, y, str(number), fontsize=7, ha="center", va="center", color=TEXT, zorder=4)
            axes.plot(*line[0], marker="o", markersize=2.5, color=TEXT, zorder=4)
        elif sewn is not None:
            box = {"boxstyle": "circle,pad=0.2", "facecolor": "white", "edgecolor": sewn[1], "linewidth": 1.0}
            x, y = line[SAMPLES // 2]
            axes.text(x, y, str(sewn[0]), fontsize=6, ha="center", va="center", color=TEXT, bbox=box, zorder=3)
    low, high = moved.min(axis=0), moved.max(axis=0)
    centre, half = (low + high) / 2, np.array([0, 0.15 * (high - low)[1]])
    arrow = {"arrowstyle": "<->", "color": OUTLINE, "linewidth": 0.7}
    axes.annotate("", centre - half, centre + half, arrowprops=arrow, zorder=2)
    inside = (high - low)[1] > TALL and (high - low)[0] > len(panel.name) * LETTER
    x, y = centre if inside else (centre[0], low[1] - LETTER)
    label = {"facecolor": FABRIC if inside else "none", "edgecolor": "none", "pad": 1.0}
    axes.text(
        x, y, panel.name, fontsize=8, ha="center", va="center" if inside else "top", color=TEXT, bbox=label, zorder=3
    )
