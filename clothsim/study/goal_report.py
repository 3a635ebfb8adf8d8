"""Goal of a study: its difference between the scene and the finest run, by triangles, in numbers and a picture."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from clothsim.base.errors import InputError
from clothsim.engine import Built
from clothsim.study.evaluation import Gatherer
from clothsim.study.goal_error import EFFECTIVE, Goal, GoalError, goal_error
from clothsim.study.points import BASE, Bench, Point, point
from clothsim.study.state_at_rest import refuse_history

PICTURE_NAME, ARRAYS_NAME = "goal.png", "goal.npz"


@dataclass(frozen=True)
class NamedGoal:
    """A goal of a study.

    Parameters
    ----------
    name : str
        For the reports, as "hem".
    loss : callable
        Makes it from the world of the scene.
    """

    name: str
    loss: Goal


def refuse_goal(built: Built, bench: Bench) -> None:
    """InputError for a scene of which no goal can be attributed to triangles."""
    refuse_history(built)
    if "cells" not in bench.knobs:
        raise InputError("The error of a goal by triangles needs finer cells, and they are no knob of this study.")


def goal_report(gatherer: Gatherer, goal: NamedGoal) -> dict[str, Any]:
    """Return the entry "goal" of study.json, and write its arrays and picture to the directory of the study.

    Its key "failed" holds the reason where there is no attribution.
    """
    finer = _finest(gatherer)
    if finer is None:
        return {"name": goal.name, "failed": "no run with finer cells came to its end"}
    bench = gatherer.bench
    ends = [gatherer.own_positions(where) for where in (BASE, finer)]
    try:
        found = goal_error(bench.scene(BASE), ends[0], bench.scene(finer), ends[1], goal.loss)
    except InputError as error:
        return {"name": goal.name, "failed": error.sentence.rstrip(".")}
    np.savez(
        gatherer.directory / ARRAYS_NAME,
        positions=found.positions,
        triangles=found.triangles,
        by_vertex=found.by_vertex,
        by_triangle=found.by_triangle,
    )
    draw_goal(found, goal.name, gatherer.directory / PICTURE_NAME)
    low, high = EFFECTIVE
    return {
        "name": goal.name,
        "value": found.coarse,
        "finer": found.fine,
        "cells": bench.settings(finer)["cells"],
        "difference": found.true,
        "estimated": found.estimated,
        "effectivity": found.effectivity,
        "believed": bool(low <= found.effectivity <= high),
        "sum_of_parts": float(found.by_triangle.sum()),
        "area_of_half": found.area_of(0.5),
        "failed": "",
    }


def draw_goal(found: GoalError, name: str, file: Path) -> None:
    """Write a picture of the cloth, each vertex coloured by its part of the error for its area, the mean being 1."""
    from clothsim.render import Quantity, Surface, draw

    rows, n = found.triangles.ravel(), len(found.positions)
    around = np.bincount(rows, np.repeat(found.areas, 3), n)
    parts = np.bincount(rows, np.repeat(found.by_triangle, 3), n)
    mean = found.by_triangle.sum() / found.areas.sum()
    density = parts / np.where(around > 0.0, around, 1.0) / (mean or 1.0)
    surface = Surface("cloth", found.positions, found.triangles, "cloth", np.zeros((0, 2)), density)
    quantity = Quantity(f"error of {name} by area, its mean 1")
    draw(file, [surface], colour=quantity, smooth=False, title=f"What makes the error of {name}")


def goal_lines(goal: dict[str, Any]) -> list[str]:
    """Return the lines for people, with the heights and lengths in metres."""
    if goal["failed"]:
        return [f"Goal {goal['name']}: not by triangles: {goal['failed']}."]
    cells = goal["cells"]
    mesh = "x".join(map(str, cells)) if isinstance(cells, list | tuple) else str(cells)
    area = f"{100 * goal['area_of_half']:.2g} % of the cloth ({PICTURE_NAME})"
    lines = [
        f"Goal {goal['name']}: {goal['value']:.6g}, {goal['difference']:+.3g} with {mesh} cells.",
        f"By triangles: {goal['estimated']:+.3g} ({goal['effectivity']:.2f} of it), without signs "
        f"{goal['sum_of_parts']:.2g}, half of that in {area}.",
    ]
    if not goal["believed"]:
        lines.append("The estimate is off by more than a factor of 2: the two meshes differ too much for the picture.")
    return lines


def _finest(gatherer: Gatherer) -> Point | None:
    """The run with the finest cells and all else as at the base."""
    finer = [where for where in gatherer.outcomes if gatherer.good(where) and where == point(dict(where.levels))]
    finer = [where for where in finer if dict(where.levels).keys() == {"cells"} and where.level("cells") > 0]
    return max(finer, key=lambda where: where.level("cells"), default=None)
