"""Pictures of a study: error against processor seconds, contributions to it, and the error of a goal on the cloth."""

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from clothsim.base.arrays import Floats
from clothsim.render import Quantity, Surface, draw
from clothsim.study.analysis import RESOLVED, Findings
from clothsim.study.parameters import written
from clothsim.study.points import BASE, PRESETS, Point
from clothsim.study.result import MM, StudyData

if TYPE_CHECKING:
    from clothsim.study.goal_report import GoalError

STYLES = (
    ("#1b4f72", "o", "-"),
    ("#b9770e", "s", "--"),
    ("#196f3d", "^", "-."),
    ("#922b21", "v", (0, (1, 1.2))),
    ("#6c3483", "D", (0, (5, 1, 1, 1, 1, 1))),
    ("#5d6d7e", "P", (0, (3, 1, 1, 1))),
)
"""Colour, marker and line of each parameter: distinguished in grey by the last two."""

STRIDE, SHORT = 6.0, 110.0
"""Pixels between places along a curve that no label may cover; a curve shorter than SHORT gets one label."""

Mark = tuple[float, float, str, str]
"""Seconds, error, text, colour."""


def draw_study(study_data: StudyData, findings: Findings, target: Path) -> None:
    """Write the picture of a study as PNG."""
    figure = Figure(figsize=(9.6, 4.8), dpi=160, layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2, width_ratios=(2.1, 1))
    _bars(right, study_data, findings)
    _against_seconds(left, study_data, findings)
    figure.savefig(target)


def _against_seconds(axes: Any, study_data: StudyData, findings: Findings) -> None:
    """Log error against log seconds: curves, the front, the variants, what the reference does not resolve."""
    axes.set(xscale="log", yscale="log", xlabel="processor time of the run [s]")
    axes.set_ylabel(f"RMS error {'of the histogram of heights' if study_data.chaotic else 'at the last frame'} [mm]")
    axes.set_title(f"{study_data.name}: what accuracy costs", loc="left", fontsize=10)
    x, y = _coordinates(findings, list(findings.errors))
    low, high = min(each for each in y if each > 0), max(y)
    axes.set_xlim(min(x) / 1.7, max(x) * 1.7)
    axes.set_ylim(low / 1.8, high * 1.8)
    floor = RESOLVED * findings.reference.error / MM
    if floor > axes.get_ylim()[0]:
        axes.axhspan(axes.get_ylim()[0], min(floor, axes.get_ylim()[1]), color="0.94", zorder=0, lw=0)
        axes.text(
            0.01, 0.012, "below ten times the reference's own error", transform=axes.transAxes, fontsize=7, color="0.4"
        )
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=20))
        axis.set_major_formatter(FuncFormatter(lambda value, place: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())
    axes.grid(True, which="major", color="0.9", lw=0.6)
    axes.set_axisbelow(True)
    axes.figure.canvas.draw()  # places the axes: the labels are laid out in pixels
    swept: set[Point] = {BASE}
    marks: list[Mark] = [(*_seconds_and_error(findings, BASE), "as given", "black")]
    lines = [axes.transData.transform([_seconds_and_error(findings, where) for where in findings.errors])]
    variants = [where for where in findings.errors if where.variant]
    marks += [(*_seconds_and_error(findings, where), where.variant, "black") for where in variants]
    for (name, parameter), (colour, marker, line) in zip(study_data.bench.parameters.items(), STYLES * 2, strict=False):
        curve = sorted(
            [
                where
                for where in findings.errors
                if where == BASE or (not where.variant and len(where.levels) == 1 and where.levels[0][0] == name)
            ],
            key=lambda where: where.level(name),
        )
        swept.update(curve)
        if len(curve) < 2:
            continue
        x, y = _coordinates(findings, curve)
        axes.plot(x, y, color=colour, marker=marker, ls=line, ms=5, lw=1.3, mfc="white", mec=colour, zorder=3)
        for pair in pairwise(zip(x, y, strict=True)):  # places every STRIDE pixels along the lines
            one, other = axes.transData.transform(pair)
            lines.append(np.linspace(one, other, 2 + int(np.linalg.norm(other - one) / STRIDE)))
        ends = [end for end in (curve[0], curve[-1]) if end != BASE]
        texts = [written(name, parameter.value(study_data.bench.base, end.level(name))) for end in ends]
        if np.ptp(axes.transData.transform(np.column_stack([x, y])), axis=0).max() < SHORT:
            ends, texts = ends[-1:], [name]
        marks += [(*_seconds_and_error(findings, end), text, colour) for end, text in zip(ends, texts, strict=True)]
    rest = [where for where in findings.errors if where not in swept and not where.variant]
    axes.plot(*_coordinates(findings, rest), ls="", marker=".", ms=6, color="0.45", zorder=2)
    axes.plot(*_coordinates(findings, list(findings.front)), color="0.84", lw=8, solid_capstyle="round", zorder=1)
    for where in variants:
        star = {"marker": "*", "ms": 12} if where.variant in PRESETS else {"marker": "X", "ms": 7}
        axes.plot(*_coordinates(findings, [where]), ls="", mfc="0.1", mec="white", zorder=5, **star)
    axes.plot(*_coordinates(findings, [BASE]), ls="", marker="o", ms=9, mfc="none", mec="black", mew=1.4, zorder=6)
    corner = findings.front[len(findings.front) // 2]
    marks.append((*_seconds_and_error(findings, corner), "front", "0.4"))
    _labelled(axes, marks, np.concatenate(lines))


def _seconds_and_error(findings: Findings, where: Point) -> tuple[float, float]:
    return findings.seconds[where], findings.errors[where] / MM


def _coordinates(findings: Findings, points: Sequence[Point]) -> tuple[list[float], list[float]]:
    return [findings.seconds[where] for where in points], [findings.errors[where] / MM for where in points]


def _labelled(axes: Any, marks: Sequence[Mark], points: Floats) -> None:
    """Write each text beside its mark, where neither a text nor one of `points` (k, 2) [pixels] is.

    One that finds no room is left out.
    """
    transform, frame = axes.transData, axes.bbox
    letter = 0.06 * axes.figure.dpi  # of 8 points
    taken = [(x - 4, y - 4, x + 4, y + 4) for x, y in points]
    for x, y, text, colour in marks:
        px, py = transform.transform((x, y))
        width, height = letter * len(text), 18.0
        for dx, dy in _PLACES:
            left = px + dx if dx > 0 else px + dx - width if dx < 0 else px - width / 2
            box = (left, py + dy - height / 2, left + width, py + dy + height / 2)
            inside = frame.x0 < box[0] and box[2] < frame.x1 and frame.y0 < box[1] and box[3] < frame.y1
            if inside and not any(
                box[0] < other[2] and other[0] < box[2] and box[1] < other[3] and other[1] < box[3] for other in taken
            ):
                break
        else:
            continue
        taken.append(box)
        shift = ((box[0] + box[2]) / 2 - px, dy)
        far = {"arrowstyle": "-", "color": colour, "lw": 0.5, "shrinkA": 0, "shrinkB": 4} if abs(dy) > 40 else None
        style = {"ha": "center", "va": "center", "fontsize": 8, "color": colour, "zorder": 7}
        axes.annotate(text, (x, y), xytext=shift, textcoords="offset pixels", arrowprops=far, **style)


_PLACES = tuple(
    (dx * far, dy * far)
    for far in (1, 1.5, 2.2, 3.2)
    for dx, dy in ((14, 0), (12, 15), (12, -15), (-14, 0), (-12, 15), (-12, -15), (0, 20), (0, -20))
)
"""Candidate positions of a label, in pixels from its mark."""

Box = tuple[float, float, float, float]


def _bars(axes: Any, study_data: StudyData, findings: Findings) -> None:
    """Error contributions of the parameters at the base settings, and the remainder."""
    rows = sorted(findings.bars.items(), key=lambda row: row[1])
    rest = [("remainder", findings.remainder / MM)] if findings.reference.combined else []
    names = [name for name, _ in rest]
    for name, _ in rows:  # with the observed slope and the expected one
        each, expected = findings.reference.limits[name], study_data.bench.parameters[name].order(study_data.bench.base)
        observed = f"{each.order:.2f}" if each.order == each.order else "not seen"
        known = expected is not None and each.extrapolated
        names.append(f"{name}\nslope {observed},\nexpected {expected:.2g}" if known else name)
    values = [*(value for _, value in rest), *(each / MM for _, each in rows)]
    shades = [*(["0.85"] * len(rest)), *(["0.45"] * len(rows))]
    axes.barh(names, values, color=shades, edgecolor="black", lw=0.6, height=0.5)
    whole = findings.errors[BASE] / MM
    span = max([whole, *values]) * 1.25
    axes.axvline(whole, color="black", lw=1, ls=(0, (4, 2)))
    axes.text(whole, 1.01, f"all: {whole:.2g}", transform=axes.get_xaxis_transform(), ha="center", fontsize=8)
    for row, value in enumerate(values):
        inside = value > 0.75 * span
        place, colour = (value - 0.02 * span, "white") if inside else (value + 0.02 * span, "black")
        axes.text(place, row, f"{value:.2g}", va="center", ha="right" if inside else "left", fontsize=8, color=colour)
    axes.set_xlim(0, span)
    axes.set_xlabel("adds to the error as given [mm]")
    axes.tick_params(axis="y", length=0, labelsize=8)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def draw_goal(found: "GoalError", name: str, file: Path) -> None:
    """Write a picture of the cloth, each vertex coloured by its part of the error for its area, the mean being 1."""
    rows, n = found.triangles.ravel(), len(found.positions)
    around = np.bincount(rows, np.repeat(found.areas, 3), n)
    parts = np.bincount(rows, np.repeat(found.by_triangle, 3), n)
    mean = found.by_triangle.sum() / found.areas.sum()
    density = parts / np.where(around > 0.0, around, 1.0) / (mean or 1.0)
    surface = Surface("cloth", found.positions, found.triangles, "cloth", np.zeros((0, 2)), density)
    quantity = Quantity(f"error of {name} by area, its mean 1")
    draw(file, [surface], colour=quantity, smooth=False, title=f"What makes the error of {name}")
