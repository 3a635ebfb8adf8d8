"""Rigid bodies and cloth: a heavy ball caught by a held sheet, a pendulum hung on a strip, a chain over a sheet."""

from typing import Any

import numpy as np

from clothsim.run.results import Run
from clothsim.scene.scene import Scene
from tests.hard_cases.case import Case, Check, all_of

ELASTIC: dict[str, dict[str, Any]] = {"inertia": {}, "membrane": {}, "bending": {}, "gravity": {}}
EXACT = 1e-3
"""Largest change of a distance between vertices of a rigid body, as a fraction of it."""
LINKS, FEWER = 10, 4
RADIUS, BAR, STRETCH = 0.03, 0.012, 0.03


def caught(small: bool) -> Scene:
    """A ball of 100 times the sheet's mass at 5 m/s into a sheet held at its border."""
    cells = 12 if small else 40
    return Scene(
        cloth={"mesh": "rectangle", "size": [1, 1], "cells": [cells, cells], "fabric": "denim"},
        rigid={"name": "ball", "mesh": "sphere", "radius": 0.15, "subdivisions": 2 if small else 3, "density": 2500}
        | {"position": [0.03, 0.02, 0.17], "velocity": [0.5, 0, -5], "spin_degrees_per_second": [0, 720, 0]},
        effects=ELASTIC | {"pins": {"select": "boundary"}, "body_contact": {}, "self_contact": {}, "friction": {}},
        solver={"dt": 0.01, "threads": 1},
        run={"duration": 0.1 if small else 0.5},
    )


def hung(small: bool) -> Scene:
    """A bob of 50 times the mass of the strip that it swings on, from the horizontal."""
    cells = [16, 2] if small else [64, 8]
    return Scene(
        cloth={"mesh": "rectangle", "size": [0.4, 0.05], "cells": cells, "fabric": "denim"},
        rigid={"name": "bob", "mesh": "slab", "size": [0.06, 0.06, 0.06], "density": 2000, "position": [0.235, 0, 0]}
        | {"tie": [{"select": "right"}]},
        effects=ELASTIC | {"pins": {"select": "left"}, "body_contact": {}, "self_contact": {}, "strain_limit": {}},
        solver={"dt": 0.01, "threads": 1},
        run={"duration": 0.3 if small else 2.0},
    )


def link(number: int, pitch: float) -> dict[str, Any]:
    """A link of a chain that hangs down, turned by 90 degrees against its neighbours."""
    keys: dict[str, Any] = {"name": f"link{number}", "mesh": "ring", "radius": RADIUS, "thickness": BAR}
    keys |= {"segments": 16, "around": 6, "stretch": STRETCH, "position": [0, 0, -pitch * number]}
    return keys | {"rotation_degrees": [0, 90, 90 * (number % 2)]}


def chained(small: bool) -> Scene:
    """Links of steel that fall into one another by 16 mm each, the last ones onto a held sheet; the first is fixed."""
    count, pitch = FEWER if small else LINKS, 2 * RADIUS + STRETCH - 2 * BAR - 0.004
    cells = 8 if small else 20
    below = -pitch * (count - 1) - RADIUS - STRETCH / 2 - BAR / 2 - 0.01
    return Scene(
        cloth={"mesh": "rectangle", "size": [0.4, 0.4], "cells": [cells, cells], "position": [0, 0, below]},
        body=link(0, pitch),
        rigid=[link(number, pitch) | {"density": 7800} for number in range(1, count)],
        effects=ELASTIC | {"pins": {"select": "boundary"}, "friction": {"coefficient": 0.2}}
        | {"body_contact": {"d_hat": 1e-3}, "self_contact": {"d_hat": 1e-3}},
        solver={"dt": 0.01, "threads": 1},
        run={"duration": 0.2 if small else 0.6},
    )  # fmt: skip


def stays_rigid(run: Run) -> str:
    """Distances between vertices of each rigid body are those of the start."""
    rigid = [surface.name for surface in run.trajectory.surfaces if surface.rigid]
    if not rigid:
        return "the scene has no rigid body"
    first, last = ({name: points for name, points, _ in run.bodies(frame)} for frame in (0, -1))
    for name in rigid:
        before, after = (np.linalg.norm(each[name] - each[name][0], axis=1) for each in (first, last))
        change = float((np.abs(after - before)[1:] / before[1:]).max())
        if change > EXACT:
            return f"{name} is deformed by {100 * change:.2g} %"
    return ""


def moves(name: str, least: float) -> Check:
    """The centre of a rigid body has moved by at least `least` [m], and is above where a free fall would bring it."""

    def check(run: Run) -> str:
        first, last = ({one: points for one, points, _ in run.bodies(frame)}[name] for frame in (0, -1))
        moved = float(np.linalg.norm(last.mean(axis=0) - first.mean(axis=0)))
        return "" if moved >= least else f"{name} moved by {moved:.2g} m only"

    return check


CASES: tuple[Case, ...] = (
    Case("B24a", "heavy ball caught by a held sheet", caught, all_of(stays_rigid, moves("ball", 0.02))),
    Case("B24b", "heavy bob hanging from a strip", hung, all_of(stays_rigid, moves("bob", 0.1))),
    Case("B24c", "chain of rigid links over a sheet", chained, all_of(stays_rigid, moves("link3", 0.01))),
)
