"""Picture of the cost ladder: a stacked bar for each rung."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from tests.benchmarks.ladder import ASSEMBLY, CONTROL, GROUND, PHASES, SOLVE, Ladder, Rung

BELOW, OWN = "effects of the rungs above", "the effect itself"
STYLES: Mapping[str, Mapping[str, Any]] = {
    SOLVE: {"color": "0.35"},
    ASSEMBLY: {"color": "0.58"},
    CONTROL: {"color": "0.75"},
    BELOW: {"color": "#dfe8f1"},
    OWN: {"color": "#f0a04b", "hatch": "/////"},
}
"""Grey: what every effect shares. Told apart without colour by their lightness, and by the hatches."""


def draw(ladder: Ladder, target: Path) -> None:
    """Write the stacked bars as PNG."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    rungs = ladder.rungs
    figure = Figure(figsize=(9.6, 1.3 + 0.34 * len(rungs)), dpi=160, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    stacks = [_stack(rung) for rung in rungs]
    longest = max(sum(stack.values()) for stack in stacks)
    for row, (rung, stack) in enumerate(zip(rungs, stacks, strict=True)):
        left = 0.0
        for part, width in stack.items():
            axes.barh(row, width, left=left, height=0.72, edgecolor="white", linewidth=0.6, **STYLES[part])
            left += width
        said = f" {rung.milliseconds:.0f} ms, {rung.iterations:.1f} iterations"
        axes.text(left, row, said, va="center", fontsize=8)
    _name_parts(axes, stacks, longest)
    axes.set_yticks(range(len(rungs)), [rungs[0].name, *(f"+ {rung.name}" for rung in rungs[1:])], fontsize=9)
    axes.tick_params(axis="y", length=0)
    axes.set_xlim(0, 1.25 * longest)
    axes.set_ylim(len(rungs) + 0.35, -0.6)
    axes.set_xlabel("milliseconds a step")
    axes.set_title(f"Cost of each effect: {ladder.cells}x{ladder.cells} cells on a ball", loc="left", fontsize=11)
    axes.spines[["top", "right", "left"]].set_visible(False)
    figure.savefig(target)


def _stack(rung: Rung) -> dict[str, float]:
    """The milliseconds of a rung by the parts of STYLES."""
    own = (rung.name,) if rung.name in rung.parts else GROUND
    effects = [name for name in rung.parts if name not in PHASES]
    shared = {phase: rung.parts[phase] for phase in PHASES}
    below = sum(rung.parts[name] for name in effects if name not in own)
    return {**shared, BELOW: below, OWN: sum(rung.parts[name] for name in own)}


def _name_parts(axes: Any, stacks: Sequence[dict[str, float]], longest: float) -> None:
    """The name of each part below the last bar, with a line to it where it is narrow."""
    row, left, last = len(stacks) - 1, 0.0, stacks[-1]
    ends = 0.0
    for part, width in last.items():
        middle = left + width / 2
        at = max(middle, ends + 0.5 * _length(part, longest))
        axes.annotate(
            part,
            xy=(middle, row + 0.38),
            xytext=(at, row + 0.95),
            ha="center",
            va="center",
            fontsize=8,
            color="0.2",
            arrowprops={"arrowstyle": "-", "color": "0.4", "lw": 0.7, "shrinkA": 0, "shrinkB": 0},
        )
        left, ends = left + width, at + 0.5 * _length(part, longest)


def _length(text: str, longest: float) -> float:
    """About how much of the axis a name takes, with a gap."""
    return (0.0095 * len(text) + 0.02) * longest
