"""Picture of simulators at equal error: error against processor time, a panel for each sheet and time."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from tests.benchmarks.peers.equal_error import PROGRAMS, Row

STYLES: Sequence[Mapping[str, Any]] = (
    {"color": "black", "marker": "o", "ls": "-", "lw": 2.0},
    {"color": "0.45", "marker": "s", "ls": "--"},
    {"color": "#b9770e", "marker": "^", "ls": "-."},
    {"color": "#6c3483", "marker": "D", "ls": (0, (5, 1, 1, 1, 1, 1))},
    {"color": "#196f3d", "marker": "v", "ls": (0, (1, 1.2))},
    {"color": "#1b4f72", "marker": "P", "ls": (0, (4, 2))},
)
"""Colour, marker and line of each program: distinct in grey by the last two."""


def draw(found: Mapping[tuple[int, float], Sequence[Row]], target: Path) -> None:
    """Write the picture as PNG: both axes logarithmic, and the doubt of clothsim's reference as a grey band."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    figure = Figure(figsize=(1.6 + 4.2 * len(found), 4.4), dpi=160, layout="constrained")
    FigureCanvasAgg(figure)
    styles = dict(zip((program.name for program in PROGRAMS), STYLES, strict=True))
    names: dict[str, Any] = {}
    for axes, ((cells, time), rows) in zip(
        figure.subplots(1, len(found), squeeze=False)[0], found.items(), strict=True
    ):
        for row in rows:
            cpu, errors = zip(*((point[1], point[2]) for point in row.points), strict=True)
            (names[row.program],) = axes.plot(cpu, errors, ms=6, mfc="white", zorder=3, **styles[row.program])
        lowest = 0.7 * min(rows[0].doubt, *(point[2] for row in rows for point in row.points))
        axes.axhspan(lowest, rows[0].doubt, color="0.92", zorder=1)
        axes.set(xscale="log", yscale="log", xlabel="processor time [s]")
        axes.set_ylim(bottom=lowest)
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=20))
            axis.set_major_formatter(FuncFormatter(lambda value, place: f"{value:g}"))
            axis.set_minor_formatter(NullFormatter())
        axes.set_title(f"{cells} x {cells} cells, at {time:g} s", loc="left", fontsize=11)
        axes.grid(True, which="major", color="0.9", lw=0.6)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
    figure.axes[0].set_ylabel("RMS distance to its own reference [mm]")
    figure.legend(names.values(), names, loc="outside lower center", ncols=len(names), frameon=False, fontsize=9)
    figure.savefig(target)
