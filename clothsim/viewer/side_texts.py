"""Texts beside the picture: state of the run, certificate, numbers of the solver, values at a vertex, scalar bar."""

from collections.abc import Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.engine import Colouring

if TYPE_CHECKING:
    from clothsim import Run

STOPS = 17
"""Colours of the scalar bar, equally spaced."""


def table(rows: Sequence[tuple[str, str]]) -> str:
    """Two columns in Markdown."""
    cells = [(name, value.replace("|", "\\|").replace("\n", " ")) for name, value in rows]
    return "\n".join(["| | |", "| --- | --- |", *(f"| {name} | {value} |" for name, value in cells)])


def state_text(run: "Run") -> str:
    """Status and reason, whether the cloth is free of intersections, and what is inside a body."""
    free = {True: "free of intersections (exact check)", False: "**it intersects**", None: "not checked yet"}
    going = not run.summary
    status = "running or stopped" if going else run.status
    inside = [] if going else run.summary["certificate"].get("held_inside", [])
    held = [f"**{each['cloth']} is inside {each['body']}**" for each in inside]
    lines = [f"**{status}**, {len(run)} frames", "" if going else run.reason, free[run.intersection_free], *held]
    return "\n\n".join(line for line in lines if line)


def certificate_text(run: "Run") -> str:
    """What the run certifies at its end."""
    if not run.summary:
        return "The certificate comes with the end of the run."
    return table(run.certificate_rows)


def solver_text(entries: Sequence[Mapping[str, Any]], time: float) -> str:
    """Numbers of the step that ended at a time or last before it, and of all steps to it."""
    done = [entry for entry in entries if entry["time"] <= time * (1 + 1e-12)]
    if not done:
        return "before the first step"
    last = done[-1]
    rows = [
        ("step", f"{last['step']:,} of {len(entries):,}"),
        ("length of the step", f"{1e3 * last['dt']:.3g} ms"),
        ("Newton iterations", f"{last['newton_iterations']:,}, {sum(e['newton_iterations'] for e in done):,} so far"),
    ]
    return table(rows)


def vertex_text(vertex: int, position: Floats, speed: float, value: tuple[str, str]) -> str:
    """Position, speed, and name and value of what colours the cloth, at a picked vertex."""
    at = ", ".join(f"{coordinate:.4f}" for coordinate in position)
    return table([("vertex", f"{vertex:,}"), ("position [m]", at), ("speed [m/s]", f"{speed:.3g}"), value])


def speeds(positions: Floats, times: Floats) -> Floats:
    """Speed of a vertex between frames, (k,) [m/s], from its positions (k, 3) [m]; 0 in the first frame."""
    if len(times) < 2:
        return np.zeros(len(times))
    return np.concatenate([[0.0], np.linalg.norm(np.diff(positions, axis=0), axis=1) / np.diff(times)])


def legend_html(colouring: Colouring) -> str:
    """Horizontal bar of a scale with its heading and ticks, as HTML; empty where the cloth is plain."""
    scale = colouring.scale
    if scale is None:
        return ""
    painted = scale.colours(np.linspace(scale.low, scale.high, STOPS))
    stops = ", ".join("#" + "".join(f"{round(255 * channel):02x}" for channel in colour) for colour in painted)
    ticks = "".join(
        f'<span style="position:absolute; left:{left:.1f}%; transform:translateX(-{left:.1f}%)">{escape(text)}</span>'
        for left, text in ((100 * (value - scale.low) / (scale.high - scale.low), text) for value, text in scale.ticks)
    )
    return (
        f'<div style="padding:0 1em 0.4em; font-size:0.8em">{escape(" ".join(scale.heading))}'
        f'<div style="height:0.8em; background:linear-gradient(to right, {stops})"></div>'
        f'<div style="position:relative; height:1.2em">{ticks}</div></div>'
    )
