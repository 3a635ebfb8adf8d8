"""Cloth pulled through a narrow place."""

import numpy as np

from clothsim.io.run import Run
from clothsim.scene.scene import Scene
from clothsim.study.stability.case import Case
from clothsim.study.stability.twist import ELASTIC
from clothsim.study.stability.where import frames

NECK, MOUTH, DEPTH, LENGTH = 0.05, 0.22, 0.14, 0.06
"""Radius of the neck and of the mouth, height of the mouth, length of the neck below it [m]: it ends at z = 0."""


def pulled_through(small: bool) -> Scene:
    """A disk of cotton is pulled through a funnel by its middle, with friction .4."""
    rings, speed = (5, 1.0) if small else (14, 0.5)
    top = DEPTH + LENGTH
    way = top + 0.28
    cells = (24, 6) if small else (48, 12)
    mouth = {"mesh": "tube", "radius": NECK, "top_radius": MOUTH, "height": DEPTH, "cells": cells}
    neck = {"mesh": "tube", "radius": NECK, "height": LENGTH, "cells": (cells[0], 2)}
    return Scene(
        cloth={"mesh": "disk", "radius": 0.2, "cells": rings, "position": [0, 0, top]},
        body=[
            mouth | {"name": "mouth", "position": [0, 0, LENGTH + DEPTH / 2]},
            neck | {"name": "neck", "position": [0, 0, LENGTH / 2]},
        ],
        effects=ELASTIC
        | {
            "gravity": {},
            "body_contact": {},
            "self_contact": {},
            "friction": {"coefficient": 0.4},
            "pins": {"select": list(range(7)), "motion": {"velocity": [0, 0, -speed]}},
        },
        solver={"dt": 0.01},
        run={"duration": way / speed, "frames_per_second": 50},
    )


def through(run: Run) -> str:
    """Inside the neck while there, and below it at the end."""
    for time, x in zip(run.times, frames(run), strict=True):
        in_neck = (x[:, 2] > 0) & (x[:, 2] < LENGTH)
        if (np.hypot(x[in_neck, 0], x[in_neck, 1]) > NECK).any():
            return f"at {time:.3g} s a vertex is outside the neck"
    left = float(run.positions(-1)[:, 2].max())
    return f"cloth is left {left:.2g} m above the neck's end" if left > 0 else ""


CASES = (Case("B4", "pulled through a funnel, mu .4", pulled_through, through),)
