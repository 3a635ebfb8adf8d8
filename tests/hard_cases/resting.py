"""Sheets at rest, alone, above and on a table: no drift, growth or endless iteration."""

import tempfile
from functools import partial
from typing import Any

import numpy as np

from clothsim.base.process_memory import peak_memory
from clothsim.run.results import Run
from clothsim.run.simulate import simulate
from clothsim.run.step_reports import Progress
from clothsim.scene.scene import Scene
from tests.hard_cases.case import Case, Check, all_of, energy_falls, scene_of

ELASTIC: dict[str, dict[str, Any]] = {"inertia": {}, "membrane": {}, "bending": {}}
D_HAT = 4e-3
DRIFT = 1e-6
"""How far a vertex at rest may go in the second half of a run [m]."""
GROWTH = 1 << 20
"""Bytes by which the peak of the memory may grow in the second half of a run."""


def weightless(small: bool, gap: float | None = None) -> Scene:
    """A sheet without any load, alone or `gap` above a table without friction."""
    above = {"position": [0, 0, gap or 0.0], "rotation_degrees": [20, -35, 50] if gap is None else [0, 0, 0]}
    table = {"name": "table", "mesh": "slab", "size": [1, 1, 0.1], "position": [0, 0, -0.05]}
    touching = {"body_contact": {"d_hat": D_HAT}, "friction": {"coefficient": 0.0}}
    return Scene(
        cloth={"mesh": "rectangle", "size": [0.3, 0.2], "cells": [9, 6] if small else [45, 30]} | above,
        body=() if gap is None else table,
        effects=ELASTIC | ({} if gap is None else touching),
        solver={"dt": 0.01, "threads": 1},
        run={"duration": 0.5},
    )


def at_most_one_iteration(run: Run) -> str:
    """Every step is done with 0 or 1 iterations that move."""
    most = max(entry["newton_iterations"] for entry in run.record())
    return f"a step took {most} Newton iterations" if most > 1 else ""


def stays(distance: float) -> Check:
    """No vertex goes further than `distance` [m] from its start."""

    def check(run: Run) -> str:
        moved = float(np.abs(run.positions(-1) - run.positions(0)).max())
        return f"a vertex moved by {moved:.2g} m" if moved > distance else ""

    return check


def same_bits(run: Run) -> str:
    """The scene simulated again gives every frame again, to the last bit."""
    with tempfile.TemporaryDirectory() as folder:
        again = simulate(scene_of(run), folder)
        frames = range(len(run.times))
        same = len(again.times) == len(run.times)
        same = same and all(np.array_equal(run.positions(k), again.positions(k)) for k in frames)
    return "" if same else "a second run gives other bits"


def quiet(small: bool, place: str) -> Scene:
    """A minute in the small form, ten in the full one: a sheet that hangs or lies, at rest after a few seconds.

    It lies over one triangle of the table, or over the diagonal between its two.
    """
    table = {"name": "table", "mesh": "slab", "size": [1.5, 1.5, 0.1], "position": [0, 0, -0.05]}
    lying = {"body_contact": {"d_hat": D_HAT}, "friction": {}}
    hangs, off = place == "hangs", 0.3 if place == "face" else 0.0
    return Scene(
        cloth={
            "mesh": "rectangle",
            "size": [0.3, 0.3],
            "cells": [6, 6],
            "position": [off, -off, 0 if hangs else D_HAT / 2],
        },
        body=() if hangs else table,
        effects=ELASTIC
        | {"gravity": {}, "damping": {"rate": 2.0}}
        | ({"pins": {"select": "corners"}} if hangs else lying),
        solver={"dt": 0.1, "tolerance": 1e-4},
        run={"duration": 60.0 if small else 600.0, "frames_per_second": 0.5},
    )


def no_drift(run: Run) -> str:
    """From the middle of the run to its end no vertex has gone anywhere."""
    middle = len(run.times) // 2
    moved = float(np.abs(run.positions(-1) - run.positions(middle)).max())
    return f"a vertex drifted by {moved:.2g} m in {run.times[-1] - run.times[middle]:.0f} s" if moved > DRIFT else ""


def no_growth(run: Run) -> str:
    """Simulated again in this process, warm by now, the peak of its memory does not rise from the middle to the end."""
    peaks: list[int] = []

    def watch(progress: Progress) -> None:
        peaks.append(peak_memory())

    with tempfile.TemporaryDirectory() as folder:
        simulate(scene_of(run), folder, watch)
    grown = peaks[-1] - peaks[len(peaks) // 2]
    return f"memory grew by {grown:,} bytes in {len(peaks) // 2} steps" if grown > GROWTH else ""


AT_REST = all_of(at_most_one_iteration, stays(1e-12), same_bits, energy_falls)

CASES = (
    Case("B13a", "sheet at rest, no load", weightless, AT_REST, jitters=False),
    Case(
        "B13b",
        "card above a table, no gravity, no friction",
        lambda small: weightless(small, 2 * D_HAT),
        AT_REST,
        jitters=False,
    ),
    Case(
        "B13c",
        "the same, starting within d_hat",
        lambda small: weightless(small, D_HAT / 2),
        all_of(same_bits, energy_falls),
    ),
    *(
        Case(name, title, partial(quiet, place=place), all_of(no_drift, no_growth, energy_falls), slow=place != "hangs")
        for name, title, place in (
            ("B23a", "hanging sheet, at rest", "hangs"),
            ("B23b", "sheet at rest on one triangle of a table", "face"),
            ("B23c", "sheet at rest across the edge between two triangles of a table", "edge"),
        )
    ),
)
