"""Picture of the benchmark: processor time of a Newton iteration against vertices, total and by part."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from clothsim.base.errors import InputError
from tests.benchmarks.bench.measure import Measured
from tests.benchmarks.bench.page import GROUPS, grouped

LADDER = "sphere"
"""The cases of this name differ in their cells alone: they make the lines. The others are points."""

WHOLE = "all of it"
STYLES: Mapping[str, Mapping[str, Any]] = {
    WHOLE: {"color": "black", "marker": "o", "ls": "-", "lw": 2.0},
    "linear solve": {"color": "#1b4f72", "marker": "s", "ls": "--"},
    "contact and friction": {"color": "#b9770e", "marker": "^", "ls": "-."},
    "assembly": {"color": "#6c3483", "marker": "D", "ls": (0, (5, 1, 1, 1, 1, 1))},
    "cloth": {"color": "#196f3d", "marker": "v", "ls": (0, (1, 1.2))},
}
"""Colour, marker and line: distinct in grey by the last two."""
APART = 1.3
"""Labels stand at heights at least this factor apart."""


def slope(vertices: Sequence[float], times: Sequence[float]) -> float:
    """The exponent p of times ~ vertices^p, by least squares of the logarithms."""
    return float(np.polyfit(np.log(vertices), np.log(times), 1)[0])


def draw(cases: Mapping[str, Measured], target: Path) -> None:
    """Write the picture as PNG. InputError where fewer than two sizes of the sphere were measured."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    stepped = {name: row for name, row in cases.items() if row.get("iterations") and not name.startswith("aim")}
    line = sorted((row for name, row in stepped.items() if name.startswith(LADDER)), key=lambda row: row["vertices"])
    if len(line) < 2:
        raise InputError("A picture of time against vertices needs two sizes of the sphere.", 'Leave "--only" out.')
    figure = Figure(figsize=(8.4, 5.2), dpi=160, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    sizes = [row["vertices"] for row in line]
    curves = {WHOLE: [_each(row) for row in line]}
    curves |= {group: [1e3 * grouped(row)[group] / row["iterations"] for row in line] for group in GROUPS}
    curves = {name: curves[name] for name in STYLES}
    for name, times in curves.items():
        axes.plot(sizes, times, ms=6, mfc="white", zorder=3, **STYLES[name])
    _name_lines(axes, sizes, curves)
    for name, row in stepped.items():
        if not name.startswith(LADDER):
            axes.plot(row["vertices"], _each(row), marker="*", ms=11, color="0.35", mec="white", ls="", zorder=4)
            said: dict[str, Any] = {
                "xytext": (-8, 4),
                "textcoords": "offset points",
                "ha": "right",
                "fontsize": 9,
                "color": "0.25",
            }
            axes.annotate(name, (row["vertices"], _each(row)), **said)
    _axes(axes, sizes, min(row["vertices"] for row in stepped.values()))
    figure.savefig(target)


def _each(row: Measured) -> float:
    return 1e3 * row["cpu"] / row["iterations"]


def _name_lines(axes: Any, sizes: Sequence[float], curves: Mapping[str, Sequence[float]]) -> None:
    """Name and slope of each line at its right end, moved apart where two end close together."""
    height = 0.0
    for name, times in sorted(curves.items(), key=lambda curve: curve[1][-1]):
        height = max(times[-1], APART * height)
        text, place = f"{name}, slope {slope(sizes, times):.2f}", (sizes[-1] * 1.12, height)
        axes.annotate(text, place, va="center", fontsize=9, color=STYLES[name]["color"], annotation_clip=False)


def _axes(axes: Any, sizes: Sequence[float], fewest: float) -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axes.set(xscale="log", yscale="log", xlabel="vertices of the cloth")
    axes.set_ylabel("processor time of a Newton iteration [ms]")
    axes.set_title("A metre of cotton on a ball, and other scenes (stars)", loc="left", fontsize=11)
    axes.set_xlim(0.6 * fewest, 5.5 * max(sizes))
    axes.set_xticks(sizes, [f"{size:,}" for size in sizes])
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=20))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, place: f"{value:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.grid(True, which="major", color="0.9", lw=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
