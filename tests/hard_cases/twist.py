"""Self-contact: cloth twisted, compressed, driven into itself."""

from typing import Any

import numpy as np

from clothsim.run.results import Run
from clothsim.scene.scene import Scene
from tests.hard_cases.case import Case

ELASTIC: dict[str, dict[str, Any]] = {"inertia": {}, "membrane": {}, "bending": {}}


def twisted(small: bool) -> Scene:
    """A strip of cotton whose ends turn against each other: 4 turns in all, 1 in the small form."""
    turns, cells = (1.0, (20, 8)) if small else (4.0, (50, 20))
    groups = [
        {"select": side, "motion": {"rotate_degrees_per_second": [sign * 180.0, 0, 0]}}
        for side, sign in (("left", 1), ("right", -1))
    ]
    return Scene(
        cloth={"mesh": "rectangle", "size": [1.0, 0.4], "cells": cells},
        effects=ELASTIC | {"self_contact": {}, "friction": {}, "pins": {"group": groups}},
        solver={"dt": 0.02},
        run={"duration": turns},
    )


def ends_exact(run: Run) -> str:
    """The pinned ends are where their script puts them: at rest in x, on circles about the x axis."""
    start, last = run.positions(0), run.positions(-1)
    ends = np.abs(np.abs(start[:, 0]) - 0.5) < 1e-9
    turned = np.hypot(last[ends, 1], last[ends, 2]) - np.hypot(start[ends, 1], start[ends, 2])
    off = max(np.abs(turned).max(), np.abs(last[ends, 0] - start[ends, 0]).max())
    return f"a pinned vertex is {off:.2g} m off its script" if off > 1e-9 else ""


CASES = (Case("B1", "strip twisted, no gravity", twisted, ends_exact),)
